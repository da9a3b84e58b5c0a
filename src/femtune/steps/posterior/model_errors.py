"""Errors of the model in the posterior distribution: unknown changes of what no parameter represents."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.judge.widened import widened_end, widened_problem
from femtune.sampling import NuisanceClass, kept_blocks
from femtune.steps.judge.facts.tested_fields import TestedMass, tested_fields, tested_masses
from femtune.steps.judge.facts.tested_supports import TestedSupport, tested_supports

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from femtune.judge.point_masses import PointMass
    from femtune.judge.widened import WideningFactor
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.sampling import Known, Solving
    from femtune.steps.judge.facts.tested_fields import TestedField
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

_LIMITS = (5e-4, 1.0)
"""Limits of a standard deviation, relative to the usual change of a field: 0.01 to 20 % of a Young's modulus or a
thickness, 0.005 to 10 % of a mass; 0.0025 to 5 % of the mass of the model at a place where the deck has none. Wider
ones, and a half-Cauchy prior, widen the intervals of right models by more than a quarter."""
_COMMON_SHARE = 0.05
"""A common standard deviation of these: 1 % of a Young's modulus."""
_SAME = 1e-10
"""Relative size below which a direction is rounding."""
_LEAST_FACTOR = 0.2
"""On a field, where the model is solved with changes."""
_LEAST_EFFECT = 0.05
"""Standard deviations of the data by which a combination of changes of this size moves the residuals, below which it is
left out: ten times as large a change would still be half a standard deviation."""
_STIFFNESS, _MASSES = "stiffnesses", "masses"
_PARTS = "parts of properties"
_LACKING, SUPPORTS = "masses that the deck lacks", "supports that give way"
"""Classes, each with a standard deviation of its own. Values of a deck are wrong more often than something is missing
in it or a property differs from place to place: many changes that are not there must not tell that values are right."""


@dataclass(frozen=True, eq=False)
class ModelErrors:
    """Classes of unknown changes, and what they do to the residuals.

    Parameters
    ----------
    classes : of the columns of B
    B : (n, m) derivatives of the residuals by the unknown changes, in combinations of equal standard deviation
    unit : (changes, m) the combinations, in usual changes; orthonormal within a class
    usual : (changes,) the usual changes, relative to the value of the deck; of masses and supports that the deck does
        not have to the largest plausible one
    directions : (raw, changes) normalised values of what changes, of each usual change
    effects : (changes,) length of the derivative of the residuals by each change
    names, of : what the changes are of, and their classes; a class without an effect on the data is none of `classes`
    reason : why there are none; "" otherwise
    left_out : number of fields that do not change because there are too many
    not_settled : why the changes are not about the most probable ones; "" where they are
    """

    classes: tuple[NuisanceClass, ...]
    B: Reals
    unit: Reals
    usual: Reals
    directions: Reals
    effects: Reals
    names: tuple[str, ...] = ()
    of: tuple[str, ...] = ()
    reason: str = ""
    left_out: int = 0
    not_settled: str = ""

    @property
    def turn(self) -> Reals:
        """(changes, m) changes of a unit of each combination, relative as `usual`."""
        return np.asarray(self.usual[:, None] * self.unit)

    @property
    def raw(self) -> Reals:
        """(raw, m) normalised values of what changes, of a unit of each combination."""
        return np.asarray(self.directions @ self.unit)

    def drawn(self, combinations: Reals, s: Reals, rng: np.random.Generator) -> Reals:
        """(raw,) normalised values of what changes, of drawn combinations (m,) with standard deviations (m,).

        What the data do not see is normal with the standard deviation of its class, or with one from its prior where
        the data see nothing of the class.
        """
        out, by_name = np.zeros(len(self.of)), {c.name: c.columns for c in self.classes}
        for name in dict.fromkeys(self.of):
            mine = np.array([i for i, of in enumerate(self.of) if of == name])
            columns = by_name.get(name, np.zeros(0, np.int64))
            size = s[columns[0]] if len(columns) else np.exp(rng.uniform(*np.log(_LIMITS)))
            own, unit = size * rng.standard_normal(len(mine)), self.unit[np.ix_(mine, columns)]
            out[mine] = own + unit @ (combinations[columns] - unit.T @ own)
        return np.asarray(self.directions @ out)


def none_of(rows: int, reason: str = "") -> ModelErrors:
    """No errors of the model."""
    none = np.zeros((0, 0))
    return ModelErrors((), np.zeros((rows, 0)), none, np.zeros(0), none, np.zeros(0), reason=reason)


@dataclass(frozen=True, eq=False)
class UnknownChanges:
    """Unknown changes of every property, mass and support that no parameter represents.

    Of a property that a parameter sets on several parts of the structure, the parts differ from their mean.

    Parameters
    ----------
    problem : of the update, with what changes after its own parameters
    end : its evaluation at the result of the update
    own : number of its own free parameters
    changes : what changes
    rows : number of residuals, those of a prior among them
    left_out : number of fields that do not change because there are too many
    factors : on fields, the first values
    masses : at grid points, the values after these
    supports : number of the last values, compliances of supports, of which the model has derivatives alone
    """

    problem: UpdateProblem
    end: Evaluation
    own: int
    changes: tuple[_Change, ...]
    rows: int
    left_out: int
    factors: tuple[WideningFactor, ...]
    masses: tuple[PointMass, ...]
    supports: int

    @property
    def n_raw(self) -> int:
        """Number of values that change."""
        return len(self.problem.parameters.free) - self.own

    def within(self, raw: Reals) -> Reals:
        """Normalised values (raw,) at which the model can be solved: no factor near zero, and no compliances."""
        factors = np.arange(self.n_raw) < len(self.factors)
        inside = np.where(factors, np.maximum(raw, _LEAST_FACTOR - 1.0), raw)
        inside[self.n_raw - self.supports :] = 0.0
        return inside

    def slopes(self, at: Evaluation) -> Reals:
        """(rows, raw) derivatives of the residuals by the normalised values of what changes."""
        J = np.concatenate([b.jacobian for b in kept_blocks(at)])[:, self.own :]
        return np.vstack([J, np.zeros((self.rows - len(J), J.shape[1]))])

    def about(self, at: Evaluation, apart: Collection[int] = ()) -> ModelErrors:
        """The changes by their derivatives at an evaluation; some of them are apart, with a class of their own."""
        changes = [replace(c, of=c.name) if i in apart else c for i, c in enumerate(self.changes)]
        return replace(_compressed(changes, self.slopes(at)), left_out=self.left_out)

    def wanted(self, at: Evaluation, start: Known, sigma: Reals) -> Integers:
        """The changes that the data want if nothing else changes, the most wanted first.

        Parameters
        ----------
        start : residuals without changes, linearised about `at`
        sigma : (n,) sizes of the errors of the data
        """
        assert start.jacobian is not None
        columns = self.slopes(at) @ _directions(self.changes, self.n_raw)
        r, J = start.residuals / sigma, start.jacobian / sigma[:, None]
        # what the parameters do not explain
        left, size, _ = la.svd(J, full_matrices=False)
        left = left[:, size > _SAME * size[0]]
        both = np.column_stack([columns / sigma[:, None], r])
        both -= left @ (left.T @ both)
        B, y = both[:, :-1], both[:, -1]
        fall = (B.T @ y) ** 2 / np.maximum(np.sum(B**2, axis=0), _LEAST_EFFECT**2)
        return np.argsort(-fall)


def unknown_changes(study: Study, result: UpdateResult, solving: Solving) -> UnknownChanges | str:
    """What may be wrong in the model although no parameter represents it; or in words why there are no such changes."""
    if study.source.needs_runs or not study.source.has_elements:
        return "the model has no elements whose properties could change"
    fields, factors, left_out = tested_fields(study)
    try:
        masses = tested_masses(study, result, len(factors))
        supports, giving_way, couplings = tested_supports(study, result, len(factors) + len(masses))
        points = tuple(m.mass for m in masses)
        widened = widened_problem(result, study.model, factors, points, giving_way, couplings)
        end = widened_end(result, widened)
    except FemtuneError as error:
        return f"the model could not be extended by unknown changes: {error.what}"
    if _rows_of(end) != _rows_of(solving.at):
        return (
            "not all residuals have derivatives by unknown changes; of models above 1,000 free DOFs, antiresonances "
            "have none, nor have FRFs with a number of modes of the study"
        )
    own = len(result.x)
    raw = len(widened.parameters.free) - own
    changes = (*_of_fields(study, result, fields, factors, raw), *_added(masses, raw), *_added(supports, raw))
    rows = len(solving.of(solving.at, False).residuals)
    return UnknownChanges(widened, end, own, changes, rows, left_out, tuple(factors), points, len(giving_way))


def _rows_of(at: Evaluation) -> list[tuple[str, int]]:
    return [(b.label, len(b.values)) for b in kept_blocks(at)]


@dataclass(frozen=True, eq=False)
class _Change:
    """An unknown change: its class, what it is of, the usual change, and the normalised values (raw,) of it."""

    of: str
    name: str
    usual: float
    direction: Reals


def _of_fields(
    study: Study, result: UpdateResult, fields: Sequence[TestedField], factors: Sequence[WideningFactor], raw: int
) -> Iterator[_Change]:
    by_ref = {str(f.candidate.ref): f for f in fields if not f.place}
    # factors of a field by the parameters that set them
    owners: dict[tuple[str, ...], list[int]] = {}
    for i, factor in enumerate(factors):
        of_field = [a for a in study.model.assignments if a.ref == factor.ref and a.parameter in result.active]
        setting = sorted({a.parameter for a in of_field if a.elements is None or factor.elements <= a.elements})
        owners.setdefault(tuple(setting) or ("", str(factor.ref)), []).append(i)
    for own, members in owners.items():
        field, whole = by_ref[str(factors[members[0]].ref)], np.zeros(raw)
        usual = 1.0 - field.candidate.kind.lower
        whole[members] = usual
        if not own[0]:
            of_mass = "mass" in field.what or "density" in field.what
            some = "" if len(members) == len(field.factors) else ", where no parameter sets it"
            yield _Change(_MASSES if of_mass else _STIFFNESS, f"{field.field}{some}", usual, whole)
        for i in members if len(members) > 1 else ():
            # what the parts have in common is the whole, or the parameter
            direction = -whole / len(members)
            direction[i] += usual
            of_part = f", {len(factors[i].elements)} elements from {min(factors[i].elements)}"
            yield _Change(_PARTS, f"{factors[i].ref}{of_part}", usual, direction)


def _added(tested: Sequence[TestedMass] | Sequence[TestedSupport], raw: int) -> Iterator[_Change]:
    """One for each neighbourhood; supports that are tested together are left out, as the sum of theirs."""
    for one in tested:
        if len(one.factors) == 1:
            of = _LACKING if isinstance(one, TestedMass) else SUPPORTS
            direction = np.zeros(raw)
            direction[one.factors[0]] = one.scale
            yield _Change(of, f"{one.field} {one.place}", 1.0, direction)


def _directions(changes: Sequence[_Change], raw: int) -> Reals:
    """(raw, m) normalised values of the usual change of each."""
    return np.array([c.direction for c in changes]).reshape(len(changes), raw).T


def _compressed(changes: Sequence[_Change], slopes: Reals) -> ModelErrors:
    """Within a class, orthogonal combinations have the same unknown standard deviation; those without effect go."""
    directions = _directions(changes, slopes.shape[1])
    columns = slopes @ directions
    classes, blocks, units = list[NuisanceClass](), list[Reals](), list[Reals]()
    first = 0
    for name in dict.fromkeys(c.of for c in changes):
        mine = [i for i, c in enumerate(changes) if c.of == name]
        left, size, right = la.svd(columns[:, mine], full_matrices=False)
        kept = size * _COMMON_SHARE > _LEAST_EFFECT
        if not kept.any():
            continue
        unit = np.zeros((len(changes), int(kept.sum())))
        unit[mine] = right[kept].T
        classes.append(NuisanceClass(name, np.arange(first, first + unit.shape[1]), _LIMITS))
        blocks.append(left[:, kept] * size[kept])
        units.append(unit)
        first += unit.shape[1]
    if not classes:
        return none_of(len(slopes), "no change of a property, mass or support has an effect on the data")
    together, usual = np.hstack(units), np.array([c.usual for c in changes])
    effects = np.where(together.any(axis=1), la.norm(columns, axis=0) / usual, 0.0)
    names, of = tuple(c.name for c in changes), tuple(c.of for c in changes)
    return ModelErrors(tuple(classes), np.hstack(blocks), together, usual, directions, effects, names, of)
