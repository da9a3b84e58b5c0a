"""Means and covariances by propagating a cloud through the model: chapter equations (40) and (41)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.quantify.covariance_matrix import least_eigenvalue
from femtune.quantify.estimator import Estimator
from femtune.quantify.hypercube import latin_hypercube
from femtune.quantify.outputs import Counted
from femtune.quantify.repeats import OutputStatistics
from femtune.quantify.status import StochasticStatus

Reals = NDArray[np.float64]
Formula = Literal["cross-covariance", "output-difference"]

_SHORTEST, _LEAST, _TRIES = 1e-2, 1e-3, 8


@dataclass(frozen=True)
class CloudRules:
    """How the cloud is drawn and when it has converged.

    Parameters
    ----------
    samples : model solutions of one cloud
    seed : of the Latin hypercube; every iteration draws with the same one, so that the iteration has a limit
    max_iterations : clouds at most
    tolerance : change of means and standard deviations, in units of the start's standard deviations, that is none
    """

    samples: int = 1000
    seed: int = 0
    max_iterations: int = 30
    tolerance: float = 1e-4


@dataclass(frozen=True)
class CloudStep:
    """One cloud: mean (k,) and covariance (k, k) of the parameters, mean outputs (m,) and solutions so far."""

    mean: Reals
    covariance: Reals
    outputs: Reals
    solutions: int


@dataclass(frozen=True)
class CloudResult:
    """Where the cloud ended, and T (k, m) of the last step."""

    steps: tuple[CloudStep, ...]
    T: Reals
    status: StochasticStatus


def propagate(outputs: Counted, theta: Reals) -> Reals:
    """Outputs (n, m) of samples (n, k).

    Raises
    ------
    FemtuneError : ``quantify.not-finite``, and what the model raises
    """
    return np.array([outputs.values(row) for row in theta])


def update_cloud(
    outputs: Counted,
    measured: OutputStatistics,
    mean: Reals,
    C: Reals,
    by: Estimator,
    formula: Formula,
    rules: CloudRules = CloudRules(),
) -> CloudResult:
    """Move a cloud of parameters until its outputs have the measured mean and covariance.

    Means by (35) with the mean of the propagated outputs. Covariance with "cross-covariance" by (40), Khodaparast,
    Mottershead and Friswell (2008), with "output-difference" by (41), Govers and Link (2010).

    Parameters
    ----------
    mean, C : (k,), (k, k) of the first cloud

    Raises
    ------
    FemtuneError : ``quantify.not-positive``, ``quantify.too-few-samples``, ``quantify.not-finite``
    """  # fmt: skip
    steps: list[CloudStep] = []
    status, scale = StochasticStatus.CLOUD_LIMIT, by.scale
    T = np.zeros((len(mean), len(measured.mean)))
    while len(steps) < rules.max_iterations:
        mean, C, theta, z = _drawn(outputs, mean, C, steps, rules)
        T = by.matrix(outputs.linearised(mean)[1])
        steps.append(CloudStep(mean, C, z.mean(axis=0), outputs.solutions))
        moved = T @ (measured.mean - z.mean(axis=0))
        new = _next(formula, T, theta, z, measured.covariance)
        if _small(moved / scale, new, C, scale, rules.tolerance):
            status = StochasticStatus.CONVERGED
            break
        toward = _positive(C, new)
        if toward is None:
            status = StochasticStatus.NOT_POSITIVE
            break
        mean, C = mean + moved, toward
    return CloudResult(tuple(steps), T, status)


def _drawn(
    outputs: Counted, mean: Reals, C: Reals, before: list[CloudStep], rules: CloudRules
) -> tuple[Reals, Reals, Reals, Reals]:
    """A cloud and its outputs, drawn back towards the one before where it reaches values without meaning."""
    for _ in range(_TRIES):
        theta = latin_hypercube(mean, C, rules.samples, rules.seed)
        try:
            return mean, C, theta, propagate(outputs, theta)
        except FemtuneError:
            if not before:
                raise
            mean, C = 0.5 * (mean + before[-1].mean), 0.5 * (C + before[-1].covariance)
    return mean, C, theta, propagate(outputs, theta)


def _next(formula: Formula, T: Reals, theta: Reals, z: Reals, measured: Reals) -> Reals:
    k = theta.shape[1]
    joint = np.cov(np.hstack([theta, z]).T)
    C, cross, spread = joint[:k, :k], joint[:k, k:], joint[k:, k:]
    if formula == "output-difference":
        return np.asarray(C + T @ (measured - spread) @ T.T)
    return np.asarray(C - cross @ T.T + T @ (spread + measured) @ T.T - T @ cross.T)


def _positive(old: Reals, new: Reals) -> Reals | None:
    """The new covariance, or a point so far towards it that it is positive definite; None where none is."""
    length = 1.0
    while length > _SHORTEST:
        C = old + length * (new - old)
        if least_eigenvalue(C) > _LEAST:
            return np.asarray(C)
        length *= 0.5
    return None


def _small(moved: Reals, new: Reals, old: Reals, scale: Reals, tolerance: float) -> bool:
    sd = [np.sqrt(np.maximum(np.diag(c), 0.0)) / scale for c in (new, old)]
    change = np.abs((new - old) / np.outer(scale, scale)).max()
    return max(np.abs(moved).max(), np.abs(sd[0] - sd[1]).max(), change) <= tolerance
