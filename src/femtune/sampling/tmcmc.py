"""Transitional Markov chain Monte Carlo: a population that moves from the prior to the posterior in stages.

The likelihood is raised to powers that grow from zero to one. The next power is the one at which the weights of the
population, likelihood to the difference of the powers, have a coefficient of variation of one. The population is drawn
anew by these weights, and each drawn sample starts a Metropolis chain with normal steps, of as many steps as it
was drawn. The product of the mean weights is the evidence.

It asks for thousands of solutions where the other ways need a thousand. It is for those who know the method, or who
want another way to the same distribution.

Source: J. Ching, Y.-C. Chen, Transitional Markov chain Monte Carlo method for Bayesian model updating, model class
selection, and model averaging, Journal of Engineering Mechanics 133, 2007.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.optimize import brentq

from femtune.arrays import Integers, Reals

_VARIATION = 1.0
"""Coefficient of variation of the weights of a stage (Ching and Chen)."""
_STEP = 0.2
"""Standard deviation of a step over that of the population (Ching and Chen)."""
_MOST_STAGES = 200
"""Stages at most: 40 lead from a prior to a posterior that is 1e15 times as narrow."""


@dataclass(frozen=True, eq=False)
class TransitionalSamples:
    """The population of the last stage.

    Parameters
    ----------
    z : (n, d)
    log_evidence, log_evidence_sd : logarithm of the mean likelihood over the prior, and its standard deviation
    effective : effective number of independent samples of the coordinate with the fewest
    stages : number of stages
    ended : whether the power one was reached
    """

    z: Reals
    log_evidence: float
    log_evidence_sd: float
    effective: float
    stages: int
    ended: bool


@dataclass(eq=False)
class _Population:
    """Samples, their log likelihood and log prior, and the sample of the prior that each descends from.

    Samples of one ancestor are not independent of each other. Steps are short, so that few ancestors are left after
    many stages: what is known of the posterior is then no more than their number tells.
    """

    z: Reals
    log: Reals
    prior: Reals
    ancestor: Integers

    @property
    def ancestors(self) -> float:
        """Effective number of ancestors."""
        shares = np.bincount(self.ancestor) / len(self.ancestor)
        return float(1.0 / (shares @ shares))

    def mean_variance(self, values: Reals) -> float:
        """Variance of the mean of values (n,)."""
        sums = np.bincount(self.ancestor, values - values.mean())
        return max(float(sums @ sums) / len(values) ** 2, float(values.var()) / self.ancestors)


def transitional(
    log_likelihood: Callable[[Reals], Reals], log_prior: Callable[[Reals], Reals], start: Reals,
    rng: np.random.Generator, tell: Callable[[str], None] = lambda text: None,
) -> TransitionalSamples:  # fmt: skip
    """Samples of likelihood times prior.

    Parameters
    ----------
    log_likelihood : of points (m, d); −∞ where there is none
    log_prior : of points (m, d), up to a constant; −∞ outside
    start : (n, d) samples of the prior
    tell : is told the stage

    Examples
    --------
    Prior and likelihood are standard normal: the posterior has half the variance.

    >>> rng = np.random.default_rng(0)
    >>> normal = lambda z: -0.5 * np.sum(z**2, axis=1)
    >>> found = transitional(normal, normal, rng.standard_normal((2000, 1)), rng)
    >>> bool(abs(found.z.var() - 0.5) < 0.06), bool(abs(found.log_evidence + 0.5 * np.log(2.0)) < 0.1)
    (True, True)
    """
    n = len(start)
    population = _Population(start, log_likelihood(start), log_prior(start), np.arange(n))
    power, log_evidence, variance, stages = 0.0, 0.0, 0.0, 0
    while power < 1.0 and stages < _MOST_STAGES and np.isfinite(population.log).any():
        new = _next_power(population.log, power)
        weights, log_mean = _weights(population.log, new - power)
        log_evidence += log_mean
        variance += population.mean_variance(weights) / weights.mean() ** 2
        stages, power = stages + 1, new
        tell(f"stage {stages}, likelihood to the power {power:.3g}")
        population = _moved(population, weights / weights.sum(), power, log_likelihood, log_prior, rng)
    effective = min(z.var() / max(population.mean_variance(z), 1e-300) for z in population.z.T)
    deviation = float(np.sqrt(variance))
    return TransitionalSamples(population.z, log_evidence, deviation, float(effective), stages, power >= 1.0)


def _weights(log: Reals, change: float) -> tuple[Reals, float]:
    """(n,) likelihood to a power over its largest value, and the logarithm of the mean of the powers themselves."""
    weights = np.exp(change * (log - log.max()))
    return weights, float(change * log.max() + np.log(weights.mean()))


def _next_power(log: Reals, power: float) -> float:
    def excess(change: float) -> float:
        weights = _weights(log, change)[0]
        return float(weights.std() / weights.mean()) - _VARIATION

    if excess(1.0 - power) <= 0.0:
        return 1.0
    least = 1e-12 * (1.0 - power)
    if excess(least) >= 0.0:
        # the likelihood is zero in most of the population
        return power + least
    return power + float(brentq(excess, least, 1.0 - power, xtol=1e-3 * least, rtol=1e-6))


def _moved(
    population: _Population, weights: Reals, power: float, log_likelihood: Callable[[Reals], Reals],
    log_prior: Callable[[Reals], Reals], rng: np.random.Generator,
) -> _Population:  # fmt: skip
    """Chains from samples that are drawn by their weights, side by side."""
    z, n = population.z, len(population.z)
    centred = z - weights @ z
    covariance = (weights[:, None] * centred).T @ centred
    values, axes = la.eigh(covariance)
    root = _STEP * axes * np.sqrt(np.maximum(values, 0.0))
    counts = np.bincount(rng.choice(n, n, p=weights), minlength=n)
    seeds = np.flatnonzero(counts)
    now, log, prior, length = z[seeds], population.log[seeds], population.prior[seeds], counts[seeds]
    parts: list[tuple[Reals, Reals, Reals, Integers]] = []
    for step in range(int(length.max())):
        moving = np.flatnonzero(length > step)
        tried = now[moving] + rng.standard_normal((len(moving), z.shape[1])) @ root.T
        prior_there = log_prior(tried)
        log_there = np.full(len(moving), -np.inf)
        inside = np.isfinite(prior_there)
        if inside.any():
            log_there[inside] = log_likelihood(tried[inside])
        with np.errstate(invalid="ignore"):
            gain = power * (log_there - log[moving]) + prior_there - prior[moving]
        better = np.log(rng.random(len(moving))) < np.where(np.isfinite(log_there), gain, -np.inf)
        taken = moving[better]
        now[taken], log[taken], prior[taken] = tried[better], log_there[better], prior_there[better]
        parts.append((now[moving].copy(), log[moving].copy(), prior[moving].copy(), population.ancestor[seeds[moving]]))
    joined = [np.concatenate(part) for part in zip(*parts)]
    return _Population(*joined)
