"""Step control, and the linear model of a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.linalg import orth
from scipy.optimize import lsq_linear

from femtune.arrays import Reals
from femtune.selection import NO_EFFECT, determined

# ----------------------------------------------------------------------------------------------------
# One bounded, damped least-squares step (Levenberg-Marquardt with the bounds inside the step).


_ROUNDING = 1e-7


def bounded_step(
    r: Reals, J: Reals, damping: float, lower: Reals, upper: Reals, spread: Reals, held: Reals | None = None
) -> Reals:
    """d that minimises |J d + r|² + damping·s²|d/spread|² with lower ≤ d ≤ upper.

    `spread` (k,) are the parameters' prior standard deviations, in which steps are measured, and s is the largest
    singular value of J·spread. Combinations that hold still stay where they are, see `still_directions`; so do those
    of `held` (h, k), of which held·d vanishes.
    """
    free = lower < upper
    d = np.zeros(J.shape[1])
    if not free.any():
        return d
    scaled = without(J[:, free] * spread[free], None if held is None else held[:, free] * spread[free])
    still, size = still_directions(scaled, r)
    scaled = scaled - (scaled @ still.T) @ still
    rows = np.vstack([scaled, np.sqrt(damping) * size * np.eye(scaled.shape[1]), size * still])
    target = np.concatenate([-r, np.zeros(len(rows) - len(r))])
    d[free] = spread[free] * _solve(rows, target, lower[free] / spread[free], upper[free] / spread[free])
    return np.clip(d, lower, upper)


def without(scaled: Reals, held: Reals | None) -> Reals:
    """Rows (n, k) that are independent of combinations (h, k), which are fixed."""
    if held is None or not len(held):
        return scaled
    basis = orth(held.T)
    return np.asarray(scaled - (scaled @ basis) @ basis.T)


def still_directions(scaled: Reals, r: Reals) -> tuple[Reals, float]:
    """(m, k) unit vectors of combinations that must not move, and the largest singular value of a scaled Jacobian.

    Where the residuals have about the size of their standard deviations, these are combinations that the data do not
    determine: noise would drive them to their bounds. Where all residuals are far smaller, the deviations are weights
    that say nothing of scatter, and only combinations without any effect but rounding are held.
    """
    # left vectors are not wanted: all of them would be as many as there are residuals
    _, s, vt = np.linalg.svd(scaled, full_matrices=len(scaled) < scaled.shape[1])
    s = np.concatenate([s, np.zeros(len(vt) - len(s))])
    still = s <= _ROUNDING * s.max(initial=0.0)
    if np.sqrt(np.mean(r**2)) > NO_EFFECT:
        still |= ~determined(s)
    return vt[still], float(s.max(initial=0.0)) or 1.0


def _solve(rows: Reals, target: Reals, lower: Reals, upper: Reals) -> Reals:
    unbounded = np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0], dtype=float)
    if ((unbounded >= lower) & (unbounded <= upper)).all():
        return unbounded
    return lsq_linear(rows, target, bounds=(lower, upper), method="bvls", tol=1e-14, max_iter=20 * rows.shape[1]).x


LEAST = 1e-12
"""Zero damping."""


@dataclass(frozen=True, eq=False)
class LocalModel:
    """r + J d within the bounds; `spread` is the scale of each parameter's steps.

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
        """Predicted decrease of ½rᵀr over d."""
        linear = self.residuals + self.jacobian @ d
        return 0.5 * float(self.residuals @ self.residuals) - 0.5 * float(linear @ linear)


class Search(Protocol):
    """Step control; `state` is one number that is passed from one trial to the next."""

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
        """True if a step is accepted; `gain` is actual over predicted decrease of the objective."""
        ...

    def longer(self, state: float, gain: float) -> float:
        """State after an accepted step."""
        ...

    def shorter(self, state: float) -> float | None:
        """State after a rejected step; None if there is no further trial."""
        ...


# ----------------------------------------------------------------------------------------------------
# Gauss-Newton: every step is taken as it comes, as the textbook's sensitivity method does.


@dataclass(frozen=True)
class GaussNewton:
    """Full steps even if the objective increases, as in published examples; it may diverge."""

    start: float = 1.0
    words: str = "Gauss-Newton with full steps, bounded steps"

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


# ----------------------------------------------------------------------------------------------------
# Levenberg-Marquardt: damping that shortens and turns the step, the bounds inside it.


_MOST = 1e12


@dataclass(frozen=True)
class LevenbergMarquardt:
    """The state is the damping, relative to the largest singular value of the scaled Jacobian squared."""

    start: float = 1e-3
    words: str = "damped Gauss-Newton (Levenberg-Marquardt), bounded steps"

    def step(self, local: LocalModel, state: float) -> Reals:
        """The damped step."""
        return local.step(state)

    def accepts(self, gain: float) -> bool:
        """Accepted for a minimum decrease."""
        return gain > 1e-4

    def longer(self, state: float, gain: float) -> float:
        """Less damping if the actual decrease agrees with the predicted decrease, more if it does not."""
        if gain > 0.75:
            return max(0.1 * state, LEAST)
        return state if gain > 0.25 else 4.0 * state

    def shorter(self, state: float) -> float | None:
        """Ten times the damping."""
        more = max(10.0 * state, 1e-6)
        return more if more <= _MOST else None


# ----------------------------------------------------------------------------------------------------
# Line search: the undamped step, halved until the objective falls.


_LEAST = 1e-10


@dataclass(frozen=True)
class LineSearch:
    """The state is the fraction of the Gauss-Newton step; it is one at the beginning of each iteration.

    Since the bounds hold for the whole step, they hold for a part of it too.
    """

    start: float = 1.0
    words: str = "Gauss-Newton with line search, bounded steps"

    def step(self, local: LocalModel, state: float) -> Reals:
        """A part of the Gauss-Newton step."""
        return state * local.step()

    def accepts(self, gain: float) -> bool:
        """Accepted for a minimum decrease."""
        return gain > 1e-4

    def longer(self, state: float, gain: float) -> float:
        """The whole step again."""
        return 1.0

    def shorter(self, state: float) -> float | None:
        """Half of it."""
        return 0.5 * state if state > _LEAST else None
