"""The parameters of nominally identical specimens: common ones, and individual ones for each specimen.

A study states each parameter once. If it is individual, the update has one for each specimen, with the name of the
specimen appended; the same holds for a parameter that is tied to an individual one. The matrices of all specimens are
the
same: their models differ in the parameters that set the values.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from femtune.files.study_file.specimens import individual_name
from femtune.model.parametric import of_specimen
from femtune.parameters import DerivedQuantity, Expression, Parameter, ParameterSet, parse_expression

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.model import ParametricModel


@dataclass(frozen=True, eq=False)
class Specimens:
    """The specimens of a study.

    Parameters
    ----------
    names : of the specimens
    individual : names in the study of the individual parameters, tied ones included
    parameters : common and individual parameters of all specimens
    models : the model of each specimen, with all these parameters
    """

    names: tuple[str, ...]
    individual: frozenset[str]
    parameters: ParameterSet
    models: Mapping[str, ParametricModel]

    def expand(self, name: str) -> tuple[str, ...]:
        """The parameters of the update that a name in the study stands for."""
        return tuple(individual_name(name, s) for s in self.names) if name in self.individual else (name,)

    def in_study(self, name: str) -> str:
        """The name in the study of a parameter of the update."""
        return self._in_study.get(name, name)

    @property
    def _in_study(self) -> dict[str, str]:
        return {individual_name(name, s): name for name in self.individual for s in self.names}

    def quantities(self, quantities: Iterable[DerivedQuantity]) -> Iterator[DerivedQuantity]:
        """Derived quantities; those of individual parameters once for each specimen."""
        for quantity in quantities:
            if self.individual.isdisjoint(quantity.expression.names):
                yield quantity
                continue
            for specimen in self.names:
                expression = _renamed(quantity.expression, self.individual, specimen)
                yield replace(quantity, name=individual_name(quantity.name, specimen), expression=expression)


def specimens_of_study(file: StudyFile, model: ParametricModel) -> Specimens | None:
    """The specimens of a study; None if it has none.

    Raises
    ------
    FemtuneError : ``tie.*``
    """
    names = file.specimens
    if not names:
        return None
    individual = _individual(file, model.parameters)
    parameters = ParameterSet(
        tuple(parameter for p in model.parameters.parameters for parameter in _of_specimens(p, individual, names))
    )
    models = {s: of_specimen(model, parameters, {n: individual_name(n, s) for n in individual}) for s in names}
    return Specimens(names, individual, parameters, models)


def _individual(file: StudyFile, parameters: ParameterSet) -> frozenset[str]:
    """The parameters that the study calls individual, and those that are tied to them."""
    individual = {entry.name for entry in file.parameter if entry.individual}
    while True:
        more = {p.name for p in parameters.parameters if p.tie is not None and not individual.isdisjoint(p.tie.names)}
        if more <= individual:
            return frozenset(individual)
        individual |= more


def _of_specimens(p: Parameter, individual: frozenset[str], names: tuple[str, ...]) -> Iterator[Parameter]:
    if p.name not in individual:
        yield p
        return
    for specimen in names:
        tie = None if p.tie is None else _renamed(p.tie, individual, specimen)
        yield replace(p, name=individual_name(p.name, specimen), tie=tie)


def _renamed(expression: Expression, individual: frozenset[str], specimen: str) -> Expression:
    """The expression with the parameters of one specimen."""
    names = [re.escape(name) for name in expression.names if name in individual]
    text = re.sub(rf"\b({'|'.join(names)})\b", lambda m: individual_name(m[1], specimen), expression.text)
    return parse_expression(text, expression.where)
