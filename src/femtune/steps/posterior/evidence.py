"""The sampled evidence of a set of parameters, and what its samples predict of configurations that are left out.

Sources: X.-L. Meng, W. H. Wong, Simulating ratios of normalizing constants via a simple identity, Statistica Sinica 6,
1996; A. Vehtari, A. Gelman, J. Gabry, Practical Bayesian model evaluation using leave-one-out cross-validation and
WAIC, Statistics and Computing 27, 2017 (configurations left out by other weights of the same samples).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln, logsumexp

from femtune.errors import FemtuneError
from femtune.sampling import (
    GOOD_ERROR,
    Known,
    Likelihood,
    PosteriorSamples,
    SamplingRules,
    Solving,
    kept_blocks,
    smoothed_weights,
)
from femtune.steps.posterior.problem import likelihood_of, sampler_of, solving_of
from femtune.truncated_normal import log_mass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from femtune.arrays import Integers, Reals
    from femtune.parameters import ParameterSet
    from femtune.residuals import Evaluation, UpdateProblem
    from femtune.updating import UpdateResult

_LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class LeftOutDensity:
    """Logarithm of the density of a configuration's residuals, given those of the others.

    Parameters
    ----------
    k_hat : shape of the tail of the weights; below 0.7 the density can be trusted. None with too few samples
    """

    configuration: str
    log_density: float
    k_hat: float | None


@dataclass(frozen=True)
class SampledEvidence:
    """The logarithm of likelihood times prior, integrated, with its standard deviation."""

    log_evidence: float
    sd: float
    effective: float
    k_hat: float
    left_out: tuple[LeftOutDensity, ...] = ()


def sampled_evidence(problem: UpdateProblem, result: UpdateResult, rules: SamplingRules) -> SampledEvidence:
    """Of the parameters that an update has moved, with the errors of the data as stated or with one unknown factor.

    Raises
    ------
    FemtuneError : ``posterior.not-sampled``, ``posterior.no-likelihood``, ``posterior.few-degrees``
    """
    solving = solving_of(problem, result)
    likelihood = likelihood_of(solving, result, "stated")
    if problem.scatter == "estimated" and not likelihood.estimated:
        # with the factor fixed at one this evidence is of another kind than that of the other candidates
        raise FemtuneError("posterior.few-degrees", degrees=f"{sum(result.covariance.freedom.values()):.3g}")
    samples = sampler_of(solving, likelihood, rules, _Serial(solving)).run()
    if samples.error is not None and samples.error > GOOD_ERROR:
        # a part of the distribution may be missing, and with it a part of its integral
        reason = f"{'; '.join(samples.tried)}; the logarithms of the weights deviate by {samples.error:.2g}"
        raise FemtuneError("posterior.not-sampled", reason=reason)
    return SampledEvidence(
        samples.log_evidence + _of_priors(problem.parameters, solving.moving), samples.log_evidence_sd,
        samples.weights.effective, samples.weights.k_hat, tuple(_left_out(solving.at, samples, likelihood)),
    )  # fmt: skip


def evidence_at(at: Evaluation, scatter: str) -> float:
    """The same of a model without parameters: the likelihood, with an unknown factor integrated over its prior 1/σ."""
    blocks = kept_blocks(at)
    squares = float(sum(b.values @ b.values for b in blocks))
    count = float(sum(len(b.values) - b.lost for b in blocks))
    if scatter == "stated":
        return -0.5 * (squares + count * _LOG_2PI)
    return float(gammaln(0.5 * count) - 0.5 * count * (np.log(0.5 * squares) + _LOG_2PI) - np.log(2.0))


@dataclass(frozen=True, eq=False)
class _Serial:
    """The model at samples, one after the other: candidates are solved side by side."""

    solving: Solving

    def __call__(self, points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
        solved = [self.solving((x, derivatives)) for x in points]
        return [None if s.problem else Known(x, s.residuals, s.jacobian) for x, s in zip(points, solved)]


def _of_priors(parameters: ParameterSet, moving: Integers) -> float:
    """What makes the product of the uniform density and exp(−½ρ²)/√(2π) of a stated prior a density within bounds."""
    lower, upper = parameters.limits
    mean, sd = parameters.prior
    out = 0.0
    for i in moving:
        if parameters.free[i].prior_sd is not None:
            low, high = (lower[i] - mean[i]) / sd[i], (upper[i] - mean[i]) / sd[i]
            out += float(np.log(upper[i] - lower[i]) - np.log(sd[i]) - log_mass(low, high))
    return out


def _left_out(at: Evaluation, samples: PosteriorSamples, likelihood: Likelihood) -> list[LeftOutDensity]:
    """Each configuration left out by weights that are divided by its own density."""
    names = [b.configuration for b in kept_blocks(at) for _ in b.values]
    every = list(dict.fromkeys(names))
    if len(every) < 2:
        return []
    sizes = np.zeros((len(samples.x), samples.residuals.shape[1]))
    for j, group in enumerate(likelihood.estimated):
        sizes[:, likelihood.groups[group].rows] = samples.theta[:, j, None]
    by_row = -0.5 * (samples.residuals * np.exp(-sizes)) ** 2 - sizes - 0.5 * _LOG_2PI
    with np.errstate(divide="ignore"):
        log_weight = np.log(samples.weights.values)
    out = []
    for name in every:
        rows = [i for i, other in enumerate(names) if other == name]
        own = by_row[:, rows].sum(axis=1)
        without = smoothed_weights(log_weight - own)
        with np.errstate(divide="ignore"):
            density = float(logsumexp(np.log(without.values) + own))
        out.append(LeftOutDensity(name, density, without.k_hat if np.isfinite(without.k_hat) else None))
    return out
