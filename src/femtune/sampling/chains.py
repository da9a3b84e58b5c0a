"""Many Hamiltonian chains side by side, on a density that is cheap to evaluate for all of them at once.

Each chain moves along a trajectory of the Hamiltonian with random momentum, by leapfrog steps, and is accepted or not.
The chains share the step, which is adapted to the acceptance, and the covariance that scales the coordinates, which is
estimated from all of them. Both are held afterwards.

Sources: R. M. Neal, MCMC using Hamiltonian dynamics, Handbook of Markov Chain Monte Carlo, 2011; A. Gelman, D. B.
Rubin, Inference from iterative simulation using multiple sequences, Statistical Science 7, 1992 (R-hat).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals

LogDensity = Callable[[Reals], tuple[Reals, Reals]]
"""From points (c, d): log density (c,) and gradient (c, d)."""

MIXED = 1.01
"""R-hat below which chains have forgotten where they began."""
_ACCEPTANCE = 0.8
"""Mean probability of acceptance that the step is adapted to (the default of Stan)."""
_LENGTH = 2.4
"""Of a trajectory, at most, in standard deviations: a quarter of a period is π/2, and on a bent ridge it is longer."""
_LARGEST_STEP = 1.0
"""Largest step of a trajectory in standard deviations: leapfrog steps are stable below 2."""
_FEWEST_POINTS = 4
"""Points a coordinate from which a covariance is estimated."""
_RIDGE = 1e-9
"""Added to the estimated covariance, relative to its diagonal."""


@dataclass(frozen=True)
class ChainRules:
    """Length of the chains.

    Parameters
    ----------
    chains : side by side
    windows : iterations before the covariance is estimated again, in turn
    kept : iterations that are kept at once; again as many until R-hat is small
    most : iterations that are kept at most
    leaps : leapfrog steps of a trajectory, at most
    """

    chains: int = 48
    windows: tuple[int, ...] = (20, 30, 50)
    kept: int = 60
    most: int = 1200
    leaps: int = 80


@dataclass(frozen=True, eq=False)
class ChainSamples:
    """Samples (iterations, chains, d), and how far they can be trusted.

    Parameters
    ----------
    r_hat : largest of all coordinates
    accepted : part of the trajectories
    displacement : mean square distance of samples half a run apart over twice the variance, smallest of all
        coordinates: one of chains that move, zero of chains that stand
    """

    values: Reals
    r_hat: float
    accepted: float
    displacement: float

    @property
    def flat(self) -> Reals:
        """(n, d)."""
        return self.values.reshape(-1, self.values.shape[2])


def run_chains(
    density: LogDensity, start: Reals, rules: ChainRules, rng: np.random.Generator,
    told: Callable[[int], None] = lambda steps: None,
) -> ChainSamples:  # fmt: skip
    """Chains from starting points (c, d); `told` is told the number of their steps from time to time.

    Examples
    --------
    >>> normal = lambda z: (-0.5 * np.sum(z**2, axis=1), -z)
    >>> found = run_chains(normal, np.zeros((64, 2)), ChainRules(64), np.random.default_rng(0))
    >>> found.r_hat < 1.01, bool(abs(found.flat.std() - 1.0) < 0.05)
    (True, True)
    """
    state, warm = _Ensemble(density, start, rules, rng), 0
    for window in rules.windows:
        state.seen = []
        for _ in range(window):
            state.move(adapt=True)
        state.rescale()
        warm += window
        told(warm)
    for _ in range(rules.windows[0]):
        state.move(adapt=True)
    kept: list[Reals] = []
    accepted = []
    while True:
        for _ in range(rules.kept):
            accepted.append(state.move(adapt=False))
            kept.append(state.z.copy())
        told(warm + rules.windows[0] + len(kept))
        values = np.array(kept)
        ratio = r_hat(values)
        if ratio < MIXED or len(kept) >= rules.most:
            return ChainSamples(values, ratio, float(np.mean(accepted)), displacement(values))


def r_hat(values: Reals) -> float:
    """Largest R-hat of the coordinates of samples (n, chains, d), each chain split into halves."""
    n = len(values) // 2
    halves = np.concatenate([values[:n], values[n : 2 * n]], axis=1)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sqrt(np.max((n - 1) / n + between / within)))


def displacement(values: Reals) -> float:
    """Mean square distance of samples half a run apart, over twice their variance; the smallest of all coordinates."""
    half = len(values) // 2
    moved = np.mean((values[half : 2 * half] - values[:half]) ** 2, axis=(0, 1))
    spread = values.reshape(-1, values.shape[2]).var(axis=0)
    return float(np.min(moved / np.maximum(2.0 * spread, 1e-300)))


class _Ensemble:
    """Points z (c, d), moved in the coordinates y with z = root·y."""

    def __init__(self, density: LogDensity, start: Reals, rules: ChainRules, rng: np.random.Generator) -> None:
        self.density, self.rules, self.rng = density, rules, rng
        self.z = np.array(start)
        self.log, self.slope = density(self.z)
        self.step, self.tried = 0.1, 0
        self.seen: list[Reals] = [self.z]
        self.rescale()

    def rescale(self) -> None:
        """Take the covariance of the last points; of few or equal points only its diagonal."""
        points = np.concatenate(self.seen[len(self.seen) // 2 :])
        spread = points.std(axis=0)
        if len(points) >= _FEWEST_POINTS * points.shape[1] and (spread > 0.0).all():
            covariance = np.atleast_2d(np.cov(points.T))
            self.root = la.cholesky(covariance + np.diag(_RIDGE * np.diag(covariance)), lower=True)
        else:
            self.root = np.diag(np.where(spread > 0.0, spread, 1.0))
        self.tried = 0

    def move(self, adapt: bool) -> float:
        """One trajectory of every chain; the part that was accepted."""
        rng, step = self.rng, self.step * self.rng.uniform(0.8, 1.2)
        leaps = int(np.clip(np.ceil(rng.uniform(0.5, 1.0) * _LENGTH / step), 1, self.rules.leaps))
        p = rng.standard_normal(self.z.shape)
        before = self.log - 0.5 * np.sum(p**2, axis=1)
        z, slope, log = self.z, self.slope, self.log
        with np.errstate(over="ignore", invalid="ignore"):
            p = p + 0.5 * step * slope @ self.root
            for i in range(leaps):
                z = z + step * p @ self.root.T
                log, slope = self.density(z)
                p = p + (1.0 if i + 1 < leaps else 0.5) * step * slope @ self.root
            gain = log - 0.5 * np.sum(p**2, axis=1) - before
        chance = np.exp(np.minimum(np.where(np.isfinite(gain), gain, -np.inf), 0.0))
        take = rng.uniform(size=len(z)) < chance
        self.z = np.where(take[:, None], z, self.z)
        self.slope = np.where(take[:, None], slope, self.slope)
        self.log = np.where(take, log, self.log)
        if adapt:
            self.seen.append(self.z)
            self.tried += 1
            self.step = min(
                self.step * float(np.exp((chance.mean() - _ACCEPTANCE) * 2.0 / np.sqrt(self.tried))), _LARGEST_STEP
            )
        return float(take.mean())
