"""Runs of a small chain whose modes have a closed form."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

MASS = np.diag([2.0, 1.0, 1.5, 0.5])


def stiffness(k1: float, k2: float) -> np.ndarray:
    """A chain to ground, to whose last mass a spring k2 is tied; the modes change places as it stiffens."""
    s = np.array([k1, 2e4, 3e4, 1e4])
    K = np.diag(s + np.append(s[1:], 0.0)) - np.diag(s[1:], 1) - np.diag(s[1:], -1)
    K[3, 3] += k2
    return K


def modes(point: np.ndarray, count: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and shapes of unit modal mass."""
    values, shapes = la.eigh(stiffness(*point), MASS)
    return np.sqrt(values[:count]) / (2 * np.pi), shapes[:, :count]


def sample(count: int, width: float = 0.6, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(1 - width, 1 + width, (count, 2)) * [1e4, 2e4]
