"""Line search: the undamped step, halved until the objective falls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.update.search.search import LocalModel

Reals = NDArray[np.float64]

_LEAST = 1e-10


@dataclass(frozen=True)
class LineSearch:
    """The state is the fraction of the Gauss-Newton step; it begins each iteration with the whole of it.

    Since the bounds hold for the whole step, they hold for a part of it too.
    """

    start: float = 1.0
    words: str = "Gauss-Newton with line search, bounds inside the step"

    def step(self, local: LocalModel, state: float) -> Reals:
        """A part of the Gauss-Newton step."""
        return state * local.step()

    def accepts(self, gain: float) -> bool:
        """Any decrease worth the name."""
        return gain > 1e-4

    def longer(self, state: float, gain: float) -> float:
        """The whole step again."""
        return 1.0

    def shorter(self, state: float) -> float | None:
        """Half of it."""
        return 0.5 * state if state > _LEAST else None
