"""Errors of the model about the changes that the data want, instead of about none.

The residuals of a model with unknown changes q are nonlinear in q: changes of 10 % move strong data by many standard
deviations more or less than their derivatives at q = 0 say. So they are linearised about the most probable parameters
and changes (x̂, q̂), which are found as by Gauss and Newton: the most probable ones of the linearised residuals, a
solution with derivatives there, and again. The samples then have

    r(x, q) = r(x, 0) + c + D (x − x̂) + B (q − q̂),

with c and D the differences of the residuals and of their derivatives by the parameters at x̂ with and without q̂.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from femtune.errors import FemtuneError
from femtune.sampling import Known, SamplingRules, Shift, kept_blocks
from femtune.steps.posterior.problem import likelihood_of, sampler_of

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.residuals import Evaluation
    from femtune.sampling import Likelihood, Solving
    from femtune.sampling.kinds import NoiseRule
    from femtune.steps.posterior.model_errors import ModelErrors, UnknownChanges
    from femtune.updating import UpdateResult

_SMALL_MISS = 0.5
"""Length, in standard deviations of the data, of what linearised residuals miss: it changes the log likelihood of
residuals of usual size by about as much."""
MOST_DOFS = 50_000
"""Free DOFs up to which the model is solved with changes: modes and their derivatives by a hundred factors."""
_MOST_ROUNDS = 8
"""Linearisations; three do for values that are 50 % wrong."""
_MOST_APART = 3
"""Changes apart from their class: each is one more size to be sampled."""
_TRIED = 4
"""Changes that are tried apart from their class, those that the data want most by themselves."""
_LEAST_GAIN = 2.0
"""Of log density with the prior of a further standard deviation, which costs two: of forty changes of a right model one
gains as much in a fortieth of all tests."""
_HALVINGS = 4
"""Of a step that does not lead to a more probable model: a sixteenth of it is no progress."""


@dataclass(frozen=True, eq=False)
class _Centre:
    """The model with changes at a point.

    Parameters
    ----------
    raw : (raw,) normalised values of what changes
    start : its parameters, residuals and their Jacobian
    at : the evaluation
    """

    raw: Reals
    start: Known
    at: Evaluation


def about_most_probable(
    changes: UnknownChanges, solving: Solving, result: UpdateResult, noise: NoiseRule, rules: SamplingRules
) -> tuple[Solving, ModelErrors]:
    """The errors of the model, and the model at samples with what their most probable changes add to it.

    Where the linearised residuals hold without changes, these are about none, and the model is as it is; above
    `MOST_DOFS` too.
    """
    first = here = _Centre(np.zeros(changes.n_raw), _known(changes, solving, changes.end), changes.end)
    apart = frozenset[int]()
    for number in range(_MOST_ROUNDS):
        slopes = changes.slopes(here.at)
        moved = replace(here.start, residuals=here.start.residuals - slopes @ here.raw)
        apart = _apart(changes, solving, result, noise, rules, here.at, moved, apart)
        errors, likelihood, x, theta, _ = _most_likely(changes, solving, result, noise, rules, here.at, moved, apart)
        if not errors.classes:
            return solving, errors
        if any(case.configured.n_free > MOST_DOFS for case in changes.problem.cases):
            break
        linear = moved.residuals + np.asarray(moved.jacobian) @ (x - moved.x)
        q = likelihood.factors(linear[None], theta[None])[0]
        raw = changes.within(errors.raw @ q)
        there = _better(changes, solving, here, x, raw, likelihood, errors, theta)
        if there is None:
            break
        missed = there.start.residuals - (
            here.start.residuals + np.asarray(here.start.jacobian) @ (there.start.x - here.start.x)
            + slopes @ (there.raw - here.raw)
        )  # fmt: skip
        small = float(np.linalg.norm(missed)) < _SMALL_MISS
        if small and number == 0:
            break
        here = there
        if small:
            break
    errors = changes.about(here.at, apart)
    if here is first:
        return solving, errors
    own = solving((here.start.x, True))
    if own.problem or own.jacobian is None:
        return solving, changes.about(first.at, apart)
    constant = here.start.residuals - changes.slopes(here.at) @ here.raw - own.residuals
    slope = np.asarray(here.start.jacobian) - own.jacobian
    return replace(solving, shift=Shift(here.start.x, constant, slope)), errors


def _most_likely(
    changes: UnknownChanges, solving: Solving, result: UpdateResult, noise: NoiseRule, rules: SamplingRules,
    at: Evaluation, start: Known, apart: frozenset[int],
) -> tuple[ModelErrors, Likelihood, Reals, Reals, float]:  # fmt: skip
    """Of linearised residuals: errors of the model, likelihood, parameters and sizes, and their log density."""
    errors = changes.about(at, apart)
    likelihood = likelihood_of(solving, result, noise, errors)
    sampler = replace(sampler_of(solving, likelihood, rules, _unsolved), start=start)
    return errors, likelihood, *sampler.most_likely()


def _apart(
    changes: UnknownChanges, solving: Solving, result: UpdateResult, noise: NoiseRule, rules: SamplingRules,
    at: Evaluation, start: Known, apart: frozenset[int],
) -> frozenset[int]:  # fmt: skip
    """Changes whose standard deviation differs from that of their class, as far as the data tell.

    Where one value is wrong and the others of its class are right, a common standard deviation would let the data
    explain it by small changes of many, those among them that shift the parameters.
    """
    while len(apart) < _MOST_APART:
        _, likelihood, _, theta, before = _most_likely(changes, solving, result, noise, rules, at, start, apart)
        sigma = np.ones(len(start.residuals))
        for j, i in enumerate(likelihood.estimated):
            sigma[likelihood.groups[i].rows] = np.exp(theta[j])
        tried = [i for i in changes.wanted(at, start, sigma)[:_TRIED].tolist() if i not in apart]
        values = [
            _most_likely(changes, solving, result, noise, rules, at, start, apart | {i})[-1] for i in tried
        ]  # fmt: skip
        if not tried or max(values) < before + _LEAST_GAIN:
            break
        apart |= {tried[int(np.argmax(values))]}
    return apart


def _unsolved(points: object, derivatives: bool) -> list[Known | None]:
    raise AssertionError


def _known(changes: UnknownChanges, solving: Solving, at: Evaluation) -> Known:
    """Residuals of an evaluation with changes, those of a prior last."""
    blocks = kept_blocks(at)
    prior, rows = solving.side.rows(at.x[: changes.own])
    known = np.broadcast_to(solving.side.informative, len(prior))
    J = np.concatenate([*(b.jacobian[:, : changes.own] for b in blocks), rows[known]])
    values = np.concatenate([*(b.values for b in blocks), prior[known]])
    return Known(at.x[solving.moving], values, J[:, solving.moving])


def _better(
    changes: UnknownChanges, solving: Solving, here: _Centre, x: Reals, raw: Reals, likelihood: Likelihood,
    errors: ModelErrors, theta: Reals,
) -> _Centre | None:  # fmt: skip
    """The model there, or nearer, if it is more probable than here; None if it is not."""

    def cost(one: _Centre) -> float:
        # the changes of a unit are orthonormal in what moves the residuals
        q = np.linalg.lstsq(errors.raw, one.raw, rcond=None)[0]
        s = np.zeros(len(q))
        for j, of in enumerate(likelihood.classes, start=len(likelihood.estimated)):
            s[of.columns] = np.exp(theta[j])
        sigma = np.ones(len(one.start.residuals))
        for j, i in enumerate(likelihood.estimated):
            sigma[likelihood.groups[i].rows] = np.exp(theta[j])
        return float(np.sum((one.start.residuals / sigma) ** 2) + np.sum((q / s) ** 2))

    part = 1.0
    for _ in range(_HALVINGS):
        full = here.at.x.copy()
        full[solving.moving] += part * (x - here.start.x)
        full[changes.own :] += part * (raw - here.raw)
        try:
            at = changes.problem.follow(full, here.at)
            there = _Centre(full[changes.own :], _known(changes, solving, at), at)
        except FemtuneError:
            part *= 0.5
            continue
        if len(there.start.residuals) == len(here.start.residuals) and cost(there) < cost(here):
            return there
        part *= 0.5
    return None
