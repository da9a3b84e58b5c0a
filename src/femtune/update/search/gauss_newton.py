"""Gauss-Newton: every step is taken as it comes, as the textbook's sensitivity method does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.update.search.search import LocalModel

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class GaussNewton:
    """Whole steps whether the objective falls or not: the iterates of published examples; it may diverge."""

    start: float = 1.0
    words: str = "Gauss-Newton, whole steps, bounds inside the step"

    def step(self, local: LocalModel, state: float) -> Reals:
        """The Gauss-Newton step."""
        return local.step()

    def accepts(self, gain: float) -> bool:
        """Always."""
        return True

    def longer(self, state: float, gain: float) -> float:
        """The whole step."""
        return 1.0

    def shorter(self, state: float) -> float | None:
        """There is none."""
        return None
