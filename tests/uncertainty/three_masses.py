"""The chapter's three masses, Fig. 11: a dense model with exact derivatives, apart from what is tested."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.uncertainty import FunctionOutputs

Reals = NDArray[np.float64]
NAMES = ("k1", "k2", "k5")
_SLOPES = (
    np.diag([1.0, 0.0, 0.0]),
    np.diag([0.0, 1.0, 0.0]),
    np.array([[0.0, 0.0, 0.0], [0.0, 1.0, -1.0], [0.0, -1.0, 1.0]]),
)


def _modes(k: Reals) -> tuple[Reals, Reals]:
    rest = np.array([[4.0, -1.0, -3.0], [-1.0, 1.0, 0.0], [-3.0, 0.0, 4.0]])
    return np.linalg.eigh(rest + sum(x * s for x, s in zip(k, _SLOPES)))


def hertz(k: Reals) -> Reals:
    """Three frequencies; NaN where one stiffness too many is negative."""
    values = _modes(k)[0]
    return np.sqrt(np.where(values > 0.0, values, np.nan)) / (2.0 * np.pi)


def slopes(k: Reals) -> Reals:
    """∂f/∂k."""
    values, v = _modes(k)
    by = np.array([[v[:, j] @ s @ v[:, j] for s in _SLOPES] for j in range(3)])
    return by / (8.0 * np.pi**2 * np.sqrt(values) / (2.0 * np.pi))[:, None]


MODEL = FunctionOutputs(hertz, slopes)


def simulated(seed: int, count: int) -> tuple[Reals, Reals]:
    """Stiffnesses of `count` structures, N(1, .2²), and their frequencies."""
    k = 1.0 + 0.2 * np.random.default_rng(seed).standard_normal((count, 3))
    return k, np.array([hertz(row) for row in k])
