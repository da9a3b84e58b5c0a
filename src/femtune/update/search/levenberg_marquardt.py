"""Levenberg-Marquardt: damping that shortens and turns the step, the bounds inside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.update.search.search import LEAST, LocalModel

Reals = NDArray[np.float64]

_MOST = 1e12


@dataclass(frozen=True)
class LevenbergMarquardt:
    """The state is the damping, relative to the largest singular value of the scaled Jacobian squared."""

    start: float = 1e-3
    words: str = "damped Gauss-Newton (Levenberg-Marquardt), bounds inside the step"

    def step(self, local: LocalModel, state: float) -> Reals:
        """The damped step."""
        return local.step(state)

    def accepts(self, gain: float) -> bool:
        """Any decrease worth the name."""
        return gain > 1e-4

    def longer(self, state: float, gain: float) -> float:
        """Less damping where the linear model told the truth, more where it hardly did."""
        if gain > 0.75:
            return max(0.1 * state, LEAST)
        return state if gain > 0.25 else 4.0 * state

    def shorter(self, state: float) -> float | None:
        """Ten times the damping."""
        more = max(10.0 * state, 1e-6)
        return more if more <= _MOST else None
