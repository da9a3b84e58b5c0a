"""Means of the parameters from means of the outputs: chapter equation (35), a step that goes wrong shortened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.quantify.estimator import Estimator
from femtune.quantify.outputs import Counted
from femtune.quantify.status import StochasticStatus

Reals = NDArray[np.float64]

_SHORTEST = 1e-3


@dataclass(frozen=True)
class MeanStep:
    """One point of the iteration: means (k,), outputs there (m,), weighted error and model solutions so far."""

    theta: Reals
    outputs: Reals
    error: float
    solutions: int


@dataclass(frozen=True)
class Means:
    """Where the means ended: θ (k,), z(θ) (m,), G (m, k), T (k, m) of the last step, all steps."""

    theta: Reals
    outputs: Reals
    G: Reals
    T: Reals
    steps: tuple[MeanStep, ...]
    status: StochasticStatus


def update_means(
    outputs: Counted, target: Reals, start: Reals, by: Estimator, max_iterations: int = 50, tolerance: float = 1e-6
) -> Means:
    """θ with z(θ) as near to the target as the estimator brings it: θ ← θ + T(z_m − z(θ)).

    Ends where a step is below `tolerance` in units of the estimator's scale, or where the outputs are within
    `tolerance` of the target in its weights.

    Parameters
    ----------
    target : (m,) mean outputs
    start : (k,)

    Raises
    ------
    FemtuneError : what the model raises at the start
    """
    z, G = outputs.linearised(start)
    theta, steps = start, [MeanStep(start, z, _error(by, target - z), outputs.solutions)]
    status = StochasticStatus.MEANS_LIMIT
    while len(steps) <= max_iterations:
        d = by.matrix(G) @ (target - z)
        if _small(d, by, steps[-1].error, tolerance):
            status = _converged(by, G)
            break
        taken = _shortened(outputs, by, target, theta, d, steps[-1].error)
        if taken is None:
            status = StochasticStatus.MEANS_STALLED
            break
        theta = taken
        z, G = outputs.linearised(theta)
        steps.append(MeanStep(theta, z, _error(by, target - z), outputs.solutions))
    return Means(theta, z, G, by.matrix(G), tuple(steps), status)


def _small(d: Reals, by: Estimator, error: float, tolerance: float) -> bool:
    return error <= tolerance or float(np.abs(d / by.scale).max(initial=0.0)) <= tolerance


def _converged(by: Estimator, G: Reals) -> StochasticStatus:
    full = bool(by.regularisation) or by.rank(G) == G.shape[1]
    return StochasticStatus.CONVERGED if full else StochasticStatus.UNDETERMINED


def _error(by: Estimator, residual: Reals) -> float:
    return float(np.sqrt(np.mean((by.root @ residual) ** 2)))


def _shortened(outputs: Counted, by: Estimator, target: Reals, theta: Reals, d: Reals, error: float) -> Reals | None:
    """The longest of d, d/2, d/4 … that lowers the error; None where none does."""
    length = 1.0
    while length > _SHORTEST:
        try:
            z = outputs.linearised(theta + length * d)[0]
        except FemtuneError:
            # a full step from far away may reach values without meaning
            length *= 0.5
            continue
        if _error(by, target - z) < error:
            return theta + length * d
        length *= 0.5
    return None
