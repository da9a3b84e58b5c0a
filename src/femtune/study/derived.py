"""Derived quantities of a study."""

from __future__ import annotations

import numpy as np

from femtune.errors import ErrorCollector
from femtune.files.study_file import StudyFile
from femtune.parameters import DerivedQuantity, ParameterSet, parse_expression


def quantities(file: StudyFile) -> tuple[DerivedQuantity, ...]:
    """The quantities as the study defines them."""
    return tuple(
        DerivedQuantity(d.name, parse_expression(d.expression, file.where("derived", i, "expression")), d.unit)
        for i, d in enumerate(file.derived)
    )


def check_derived(file: StudyFile, parameters: ParameterSet) -> None:
    """Refuse expressions without a value at the start, all together (error ``tie.value``)."""
    errors = ErrorCollector()
    for quantity in quantities(file):
        with errors.catch():
            quantity.at(parameters, np.zeros(len(parameters.free)))
    errors.raise_if_any()
