"""Parameters proposed for a study: properties, materials and joints in use, ranked by what the modes determine.

Each candidate is a field of the deck with usual bounds. The model takes the place of the test: with stated standard
deviations of frequencies and shapes, the Fisher information tells what the measured modes could determine. Candidates
are taken in the order in which each adds most to the determinant of the information. A candidate is proposed if the
standard deviations of all proposed parameters, including its own, then stay below a third of the prior ones.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran.field_refs import resolve
from femtune.residuals import UpdateProblem, state_at
from femtune.residuals.frequency import FrequencyResidual
from femtune.residuals.shape import ShapeResidual
from femtune.selection import collinearity, fisher_information
from femtune.selection.information import KNOWN

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.built_model import BuiltModel
    from femtune.model import EigenSolution
    from femtune.parameters import ParameterSet
    from femtune.residuals import ComparedCase

MOST_RANKED = 60
"""Number of candidates that are compared; of more, those with the largest effect."""
MOST_PROPOSED = 20
"""Number of parameters that are proposed at most."""
FREQUENCY_SD = 0.005
"""Relative standard deviation of frequencies that a first study assumes where the test states none.

Repeated modal tests of one structure scatter by 0.1 to 1 %. The size of the residuals shows whether it fits.
"""
SHAPE_SD = 0.03
"""Standard deviation of the entries of a shape, relative to its largest entry, that a first study likewise assumes.

Shapes are measured less accurately than frequencies, by 1 to 10 %.
"""


@dataclass(frozen=True)
class ProposalKind:
    """Meaning of a field of some cards, and the usual bounds of the factor on it."""

    what: str
    lower: float
    upper: float


_MATERIAL = ProposalKind("material: stiffness", 0.8, 1.25)
_DENSITY = ProposalKind("material: density", 0.9, 1.1)
_THICKNESS = ProposalKind("property: thickness", 0.8, 1.25)
_SECTION = ProposalKind("property: section", 0.7, 1.4)
_JOINT = ProposalKind("joint: stiffness", 0.1, 10.0)
_MASS = ProposalKind("mass", 0.9, 1.1)

# cards, their fields, and what these are
_FIELDS = (
    ("MAT1", "E", _MATERIAL),
    ("MAT2", "G11 G22 G33", _MATERIAL),
    ("MAT8", "E1 E2 G12", _MATERIAL),
    ("MAT11", "E1 E2 E3", _MATERIAL),
    ("MAT1 MAT2 MAT8 MAT9 MAT11", "RHO", _DENSITY),
    ("PSHELL PSHEAR", "T", _THICKNESS),
    ("PTUBE", "T OD", _THICKNESS),
    ("PBARL PBEAML", "DIM1 DIM2 DIM3 DIM4 DIM5 DIM6", _THICKNESS),
    ("PBAR PBEAM PBCOMP PBEND", "I1 I2 J", _SECTION),
    ("PROD CONROD", "A", _SECTION),
    ("PELAS CELAS2 CELAS4 PBUSH1D", "K", _JOINT),
    ("PBUSH", "K1 K2 K3 K4 K5 K6", _JOINT),
    ("PGAP", "KA KT", _JOINT),
    ("CONM2 PMASS CMASS2 CMASS4", "M", _MASS),
)
KIND_OF_FIELD = {
    (card, name): kind for cards, names, kind in _FIELDS for card in cards.split() for name in names.split()
}
"""By card and field."""


@dataclass(frozen=True)
class FieldCandidate:
    """A field of the deck that could be a parameter."""

    ref: FieldRef
    kind: ProposalKind
    value: float

    @property
    def name(self) -> str:
        """A name that a study may use: ``E_MAT1_2``."""
        return re.sub(r"\W", "_", f"{self.ref.name}_{self.ref.card}_{self.ref.id}")

    @property
    def table(self) -> dict[str, object]:
        """The keys of its [[parameter]]."""
        return {
            "name": self.name, "fields": (str(self.ref),), "lower": self.kind.lower, "upper": self.kind.upper,
        }  # fmt: skip


@dataclass(frozen=True)
class Proposed:
    """A candidate and the information of the test on it, as standard deviations in % of its value.

    Parameters
    ----------
    proposed : whether it should be updated
    sd_percent : expected standard deviation if all proposed parameters are updated, and this one in addition if it
        is not proposed; None where the data do not determine it
    alone_percent : the same if all others were known; None without effect
    like : a proposed parameter with nearly the same effect, "" without one
    """

    candidate: FieldCandidate
    proposed: bool
    sd_percent: float | None
    alone_percent: float | None
    like: str = ""


def candidates(built: BuiltModel) -> list[FieldCandidate]:
    """The fields of properties, materials, joints and masses that elements use and that have usual bounds."""
    return list(fields_of_kinds(built, KIND_OF_FIELD))


def fields_of_kinds(built: BuiltModel, kinds: Mapping[tuple[str, str], ProposalKind]) -> Iterator[FieldCandidate]:
    """The fields that elements use, of the kinds that are given by card and name of the field."""
    table = built.structure.values
    for ref, value in zip(table.refs, table.values):
        kind = kinds.get((ref.card, ref.name))
        if kind is None or ref.region or not value or ref not in built.fields:
            continue
        try:
            resolve(built, ref)
        except FemtuneError:
            # what no element uses, or what follows from other fields
            continue
        yield FieldCandidate(ref, kind, float(value))


def ranked(
    fields: Sequence[FieldCandidate], parameters: ParameterSet, case: ComparedCase, solution: EigenSolution
) -> tuple[list[Proposed], int]:
    """The candidates, proposed ones first and in the order of selection; and how many were not compared.

    Parameters
    ----------
    fields : as many as the free parameters, in their order
    case : the model at the sensors, with its own modes as the test
    solution : modes at the initial values
    """
    S = sensitivities(parameters, case, solution)
    size = np.linalg.norm(S, axis=0)
    order = np.argsort(-size, kind="stable")[:MOST_RANKED]
    names = tuple(fields[i].name for i in order)
    S, some = S[:, order], [fields[i] for i in order]
    percent = 100.0 * np.asarray(parameters.prior[1])[order]
    information = fisher_information(S, names)
    taken: list[int] = []
    for j in information.d_order:
        if len(taken) < MOST_PROPOSED and _sd(S, [*taken, j]).max() <= KNOWN:
            taken.append(j)
    together = _sd(S, taken)
    cosine = np.abs(collinearity(S, names).cosine)
    out = [
        Proposed(some[j], True, _finite(sd * percent[j]), _finite(information.alone[j] * percent[j]))
        for j, sd in zip(taken, together)
    ]
    for j in information.d_order:
        if j not in taken:
            nearest = max(taken, key=lambda t: cosine[j, t], default=None)
            like = some[nearest].name if nearest is not None and cosine[j, nearest] >= _ALIKE_COSINE else ""
            sds = (_finite(_sd(S, [*taken, j])[-1] * percent[j]), _finite(information.alone[j] * percent[j]))
            out.append(Proposed(some[j], False, *sds, like))
    return out, len(fields) - len(some)


_ALIKE_COSINE = 0.95
"""Cosine of the sensitivities of two parameters from which one is said to act like the other.

The data then hardly separate them.
"""
_NO_EFFECT = 1e-9
"""Sensitivity relative to the largest below which a parameter has no effect but rounding."""


def sensitivities(parameters: ParameterSet, case: ComparedCase, solution: EigenSolution) -> Reals:
    """(n, k) derivatives of frequencies and shapes, in units of their standard deviations and those of the prior."""
    of_shapes = (ShapeResidual(SHAPE_SD, of_largest=True),) if len(case.test.dofs) else ()
    problem = UpdateProblem((case,), parameters, (FrequencyResidual(FREQUENCY_SD), *of_shapes))
    x = np.zeros(len(parameters.free))
    at = problem.assess(x, [state_at(case, x, solution)])
    S = np.asarray(at.jacobian * parameters.prior[1])
    size = np.linalg.norm(S, axis=0)
    return np.where(size > _NO_EFFECT * size.max(initial=0.0), S, 0.0)


def _sd(S: Reals, columns: list[int]) -> Reals:
    """Standard deviations of parameters updated together, in units of the prior ones; inf where undetermined."""
    if not columns:
        return np.zeros(0)
    return fisher_information(S[:, columns], ("",) * len(columns)).together


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
