"""Errors of the model in the posterior distribution: unknown changes of what no parameter represents."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.judge.widened import widened_end, widened_problem
from femtune.sampling import NuisanceClass, kept_blocks
from femtune.steps.judge.facts.tested_fields import TestedMass, tested_fields, tested_masses
from femtune.steps.judge.facts.tested_supports import TestedSupport, tested_supports

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.judge.widened import WideningFactor
    from femtune.residuals import Evaluation
    from femtune.sampling import Solving
    from femtune.steps.judge.facts.tested_fields import TestedField
    from femtune.study.study import Study
    from femtune.updating import UpdateResult

_LIMITS = (5e-4, 1.0)
"""Limits of a standard deviation, relative to the usual change of a field: 0.01 to 20 % of a Young's modulus or a
thickness, 0.005 to 10 % of a mass; 0.0025 to 5 % of the mass of the model at a place where the deck has none. Wider
ones, and a half-Cauchy prior, widen the intervals of right models by more than a quarter."""
_COMMON_SHARE = 0.05
"""A common standard deviation of these: 1 % of a Young's modulus."""
_LEAST_EFFECT = 0.05
"""Standard deviations of the data by which a combination of changes of this size moves the residuals, below which it is
left out: ten times as large a change would still be half a standard deviation."""
_STIFFNESS, _MASSES, _SUPPORTS = "stiffnesses", "masses", "supports that give way"
"""Classes. More of them, with a standard deviation each, are hardly told apart by the data."""


@dataclass(frozen=True, eq=False)
class ModelErrors:
    """Classes of unknown changes, and what they do to the residuals.

    Parameters
    ----------
    classes : of the columns of B
    B : (n, m) derivatives of the residuals by the unknown changes, in combinations of equal standard deviation
    turn : (changes, m) changes of a unit of each combination, relative to the value of the deck; of masses and
        supports that the deck does not have to the largest plausible one
    effects : (changes,) length of the derivative of the residuals by each change
    names, counts : what the changes are of, and the number of changes of each class
    reason : why there are none; "" otherwise
    left_out : number of fields that do not change because there are too many
    """

    classes: tuple[NuisanceClass, ...]
    B: Reals
    turn: Reals
    effects: Reals
    names: tuple[str, ...] = ()
    counts: tuple[int, ...] = ()
    reason: str = ""
    left_out: int = 0


def none_of(rows: int, reason: str = "") -> ModelErrors:
    """No errors of the model."""
    return ModelErrors((), np.zeros((rows, 0)), np.zeros((0, 0)), np.zeros(0), reason=reason)


def model_errors(study: Study, result: UpdateResult, solving: Solving) -> ModelErrors:
    """Unknown changes of every property, mass and support that no parameter represents, about the result.

    Of a property that a parameter sets on several parts of the structure, the parts differ from their mean.
    """
    rows = len(solving.of(solving.at, False).residuals)
    if study.source.needs_runs or not study.source.has_elements:
        return none_of(rows, "the model has no elements whose properties could change")
    fields, factors, left_out = tested_fields(study)
    try:
        masses = tested_masses(study, result, len(factors))
        supports, giving_way, couplings = tested_supports(study, result, len(factors) + len(masses))
        widened = widened_problem(result, study.model, factors, [m.mass for m in masses], giving_way, couplings)
        end = widened_end(result, widened)
    except FemtuneError as error:
        return none_of(rows, f"the model could not be extended by unknown changes: {error.what}")
    if _rows_of(end) != _rows_of(solving.at):
        return none_of(
            rows, "not all residuals have derivatives by unknown changes, as FRFs of models above 1,000 free DOFs"
        )
    J = np.concatenate([b.jacobian for b in kept_blocks(end)])[:, len(result.x) :]
    J = np.vstack([J, np.zeros((rows - len(J), J.shape[1]))])
    changes = [*_of_fields(study, result, fields, factors, J), *_added(masses, J), *_added(supports, J)]
    return replace(_compressed(changes, rows), left_out=left_out)


def _rows_of(at: Evaluation) -> list[tuple[str, int]]:
    return [(b.label, len(b.values)) for b in kept_blocks(at)]


@dataclass(frozen=True, eq=False)
class _Change:
    """An unknown change: its class, what it is of, the usual change, and ∂r by the usual change (n,)."""

    of: str
    name: str
    usual: float
    column: Reals


def _of_fields(
    study: Study, result: UpdateResult, fields: Sequence[TestedField], factors: Sequence[WideningFactor], J: Reals
) -> Iterator[_Change]:
    by_ref = {str(f.candidate.ref): f for f in fields if not f.place}
    # factors by the parameters that set them; one that none sets is by itself
    owners: dict[tuple[str, ...], list[int]] = {}
    for i, factor in enumerate(factors):
        of_field = [a for a in study.model.assignments if a.ref == factor.ref and a.parameter in result.active]
        setting = sorted({a.parameter for a in of_field if a.elements is None or factor.elements <= a.elements})
        owners.setdefault(tuple(setting) or ("", str(i)), []).append(i)
    for own, members in owners.items():
        columns = J[:, members]
        if own[0]:
            # what the parts have in common is the parameter itself
            columns = columns - columns.mean(axis=1, keepdims=True)
        if own[0] and len(members) < 2:
            continue
        for i, column in zip(members, columns.T):
            field, factor = by_ref[str(factors[i].ref)], factors[i]
            kind = field.candidate.kind
            count = len(factor.elements)
            some = "" if len(field.factors) < 2 else f", {count} elements from {min(factor.elements)}"
            usual, of_mass = 1.0 - kind.lower, "mass" in kind.what or "density" in kind.what
            yield _Change(_MASSES if of_mass else _STIFFNESS, f"{factor.ref}{some}", usual, usual * column)


def _added(tested: Sequence[TestedMass] | Sequence[TestedSupport], J: Reals) -> Iterator[_Change]:
    """One for each neighbourhood; supports that are tested together are left out, as the sum of theirs."""
    for one in tested:
        if len(one.factors) == 1:
            of = _MASSES if isinstance(one, TestedMass) else _SUPPORTS
            yield _Change(of, f"{one.field} {one.place}", 1.0, one.scale * J[:, one.factors[0]])


def _compressed(changes: Sequence[_Change], rows: int) -> ModelErrors:
    """Within a class, orthogonal combinations have the same unknown standard deviation; those without effect go."""
    classes, blocks, turns, counts = list[NuisanceClass](), list[Reals](), list[Reals](), list[int]()
    first = 0
    for name in dict.fromkeys(c.of for c in changes):
        mine = [i for i, c in enumerate(changes) if c.of == name]
        left, size, right = la.svd(np.column_stack([changes[i].column for i in mine]), full_matrices=False)
        kept = size * _COMMON_SHARE > _LEAST_EFFECT
        if not kept.any():
            continue
        turn = np.zeros((len(changes), int(kept.sum())))
        turn[mine] = right[kept].T * np.array([[changes[i].usual] for i in mine])
        classes.append(NuisanceClass(name, np.arange(first, first + turn.shape[1]), _LIMITS))
        blocks.append(left[:, kept] * size[kept])
        turns.append(turn)
        counts.append(len(mine))
        first += turn.shape[1]
    if not classes:
        return none_of(rows, "no change of a property, mass or support has an effect on the data")
    names, effects = tuple(c.name for c in changes), np.array([la.norm(c.column) / c.usual for c in changes])
    kept = np.hstack(turns).any(axis=1)
    effects[~kept] = 0.0
    return ModelErrors(tuple(classes), np.hstack(blocks), np.hstack(turns), effects, names, tuple(counts))
