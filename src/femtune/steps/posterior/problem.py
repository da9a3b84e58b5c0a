"""The posterior of an update: residuals about its result, their likelihood, and what samples it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from femtune.errors import FemtuneError
from femtune.sampling import (
    Known,
    Likelihood,
    NormalBox,
    Sampler,
    SamplingRules,
    Scaled,
    Solving,
    kept_blocks,
    noise_groups,
)
from femtune.updating.error_scales import FEWEST_DEGREES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from femtune.arrays import Integers, Reals
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.sampling.kinds import NoiseRule
    from femtune.sampling.sampler import ModelAtSamples
    from femtune.steps.posterior.model_errors import ModelErrors
    from femtune.updating import UpdateResult


def solving_of(problem: UpdateProblem, result: UpdateResult, reduced: bool = False) -> Solving:
    """The problem about the result, with all that can be sent to another process.

    Parameters
    ----------
    reduced : the problem is on other models than the result

    Raises
    ------
    FemtuneError : ``posterior.no-likelihood``
    """
    at = at_result(problem, result) if reduced else result.after
    if not kept_blocks(at):
        raise FemtuneError("posterior.no-likelihood", reason="; ".join(without_likelihood(at.weighted)))
    moving = np.flatnonzero(np.isin([p.name for p in result.parameters.free], result.active))
    sent = problem.to_send()
    # the journal keeps what the samples need, not their modes
    return Solving(sent, sent.unsolved(at), result.side, moving)


def at_result(problem: UpdateProblem, result: UpdateResult) -> Evaluation:
    """The result on the models of another problem, with the same pairs."""
    return problem.assess(result.x, problem.paired_as(result.after, problem.solved(result.x)))


def completed(x: Reals, sampled: Reals, moving: Integers) -> Reals:
    """(n, k) samples (n, k′) of the parameters that move, with the others as at x (k,)."""
    points = np.tile(x, (len(sampled), 1))
    points[:, moving] = sampled
    return points


def without_likelihood(blocks: Sequence[Any]) -> list[str]:
    """Why residuals are not in the likelihood."""
    return list(dict.fromkeys(f"{b.kind}: {b.without_distribution}" for b in blocks if b.without_distribution))


def likelihood_of(
    solving: Solving, result: UpdateResult, noise: NoiseRule, errors: ModelErrors | None = None
) -> Likelihood:
    """The likelihood with a rule for the size of the errors of the data, and with errors of the model."""
    blocks = kept_blocks(solving.at)
    kinds = np.array([b.kind for b in blocks for _ in b.values] + ["prior"] * solving.priors)
    fixed = np.arange(len(kinds)) >= len(kinds) - solving.priors
    lost: dict[str, int] = {}
    for b in blocks:
        lost[b.kind] = lost.get(b.kind, 0) + b.lost
    # standard deviations that are relative weights say nothing of the size of the errors
    rule = "common" if noise == "stated" and solving.problem.scatter == "estimated" else noise
    freedom = result.covariance.freedom if errors is None else _left(kinds, errors, result.covariance.freedom)
    groups = noise_groups(kinds, fixed, lost, rule, freedom, FEWEST_DEGREES)
    if errors is None:
        return Likelihood(groups, (), np.zeros((len(kinds), 0)))
    return Likelihood(groups, errors.classes, errors.B)


def _left(kinds: np.ndarray, errors: ModelErrors, freedom: dict[str, float]) -> dict[str, float]:
    """Degrees of freedom by kind of residual that changes of the model leave.

    Where changes explain all residuals of a kind, their noise has no size of its own: it could be nothing.
    """
    return {
        kind: min(free, float(np.sum(kinds == kind)) - _seen(errors.B[kinds == kind])) for kind, free in freedom.items()
    }


def _seen(B: Reals) -> int:
    """Number of combinations of changes that move the residuals by a standard deviation."""
    return int(np.sum(np.linalg.svd(B, compute_uv=False) > 1.0)) if B.size else 0


def sampler_of(
    solving: Solving, likelihood: Likelihood, rules: SamplingRules, model: ModelAtSamples,
    tell: Callable[[str], None] = lambda text: None,
) -> Sampler:  # fmt: skip
    """What samples it; `model` solves, `tell` is told what is done."""
    parameters, moving = solving.problem.parameters, solving.moving
    lower, upper = (ends[moving] for ends in parameters.limits)
    k = len(moving)
    positive = parameters.denormalise(parameters.limits[0])[moving] > 0.0
    scaled = Scaled(parameters.nominal[moving], parameters.scale[moving], positive, np.zeros(k), np.ones(k))
    as_it_is = replace(solving, shift=None).of(solving.at)
    start = alone = Known(np.clip(solving.at.x[moving], lower, upper), as_it_is.residuals, as_it_is.jacobian)
    if solving.shift is not None:
        there = model([solving.shift.about], True)[0]
        start = alone if there is None else there
    return Sampler(
        likelihood, NormalBox(lower, upper), start, scaled, model, rules, tell,
        None if solving.shift is None else alone,
    )  # fmt: skip
