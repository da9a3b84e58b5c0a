"""Parameters of a study on a deck that was built: their start values, bounds, and the fields that they set."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.nastran.build import BuiltModel
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.study_file import ParameterEntry, StudyFile
from femtune.model import Assignment
from femtune.parameters import Parameter, ParameterSet, parse_expression


def parameter_set(file: StudyFile, built: BuiltModel) -> ParameterSet:
    """Parameters as the study describes them; several problems are shown together.

    Raises
    ------
    FemtuneError : ``study.unknown-field``, ``parameter.*`` and ``tie.*``
    """
    errors, found = ErrorCollector(), []
    for i, entry in enumerate(file.parameter):
        with errors.catch():
            found.append(_parameter(entry, built, file.where("parameter", i)))
    errors.raise_if_any()
    return ParameterSet(tuple(found))


def assignments(file: StudyFile, built: BuiltModel) -> Iterable[Assignment]:
    """Which parameter sets which field, and for which elements."""
    for entry in file.parameter:
        region = entry.region
        chosen = None
        if region is not None:
            chosen = frozenset(int(n) for n in built.structure.element_kinds if n in region)
        for ref in entry.targets:
            yield Assignment(entry.name, ref, not entry.absolute, chosen)


def _parameter(entry: ParameterEntry, built: BuiltModel, where: Where) -> Parameter:
    positions = [resolve(built, parse_field_ref(text, where), where) for text in entry.fields]
    if entry.tie is not None:
        return Parameter(entry.name, unit=entry.unit, tie=parse_expression(entry.tie, where), where=where)
    nominal = entry.nominal
    if nominal is None:
        nominal = _deck_value(entry, built, positions, where) if entry.absolute else 1.0
    lower = nominal if entry.lower is None else entry.lower
    upper = nominal if entry.upper is None else entry.upper
    return Parameter(entry.name, nominal, lower, upper, entry.unit, entry.mean, entry.sd, None, where)


def _deck_value(entry: ParameterEntry, built: BuiltModel, positions: Sequence[int], where: Where) -> float:
    values = built.structure.values.values[list(positions)]
    if not len(values):
        raise FemtuneError(
            "parameter.no-start",
            f"parameter {entry.name}: it has no field whose value could be its start value",
            where=where,
            hint="give nominal, or leave absolute = true out so that it starts at 1",
        )
    if np.ptp(values) > 1e-12 * np.abs(values).max():
        raise FemtuneError(
            "parameter.absolute-differs",
            f"parameter {entry.name}: its fields hold different values, so there is no start value",
            where=where,
            values={str(ref): float(v) for ref, v in zip(entry.targets, values)},
            hint="give nominal, or use factors (absolute = false)",
        )
    return float(values[0])
