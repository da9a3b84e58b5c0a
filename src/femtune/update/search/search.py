"""What a search is, and the linear model that it steps on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from femtune.update.trust import bounded_step

Reals = NDArray[np.float64]

LEAST = 1e-12
"""A damping that is none."""


@dataclass(frozen=True, eq=False)
class LocalModel:
    """r + J d inside the room that the bounds leave; `spread` is the scale of each parameter's steps.

    `held` (h, k) are combinations v of which vᵀd must vanish.
    """

    residuals: Reals
    jacobian: Reals
    lower: Reals
    upper: Reals
    spread: Reals
    held: Reals

    def step(self, damping: float = LEAST) -> Reals:
        """The damped step, see `bounded_step`."""
        return bounded_step(self.residuals, self.jacobian, damping, self.lower, self.upper, self.spread, self.held)

    def gain(self, d: Reals) -> float:
        """By how much the linear model lowers ½rᵀr over d."""
        linear = self.residuals + self.jacobian @ d
        return 0.5 * float(self.residuals @ self.residuals) - 0.5 * float(linear @ linear)


class Search(Protocol):
    """How steps are tried; `state` is one number that goes from one trial to the next."""

    @property
    def words(self) -> str:
        """Its name in a report."""
        ...

    @property
    def start(self) -> float:
        """State before the first step."""
        ...

    def step(self, local: LocalModel, state: float) -> Reals:
        """The step to try."""
        ...

    def accepts(self, gain: float) -> bool:
        """Whether a step is kept whose decrease of the objective is `gain` times what the linear model foretold."""
        ...

    def longer(self, state: float, gain: float) -> float:
        """State after a step that was kept."""
        ...

    def shorter(self, state: float) -> float | None:
        """State after a step that was not; None where there is nothing else to try."""
        ...
