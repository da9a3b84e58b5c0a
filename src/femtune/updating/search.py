"""Step control, and the linear model of a step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.linalg import orth
from scipy.optimize import lsq_linear

from femtune.arrays import Reals

# ----------------------------------------------------------------------------------------------------
# One bounded, damped least-squares step (Levenberg-Marquardt with the bounds inside the step).


_RIGID = 1e6
"""Weight of the rows that hold combinations, relative to the largest singular value: bounds must not move them."""


def bounded_step(
    r: Reals, J: Reals, damping: float, lower: Reals, upper: Reals, scale: Reals, held: Reals | None = None
) -> Reals:
    """d that minimises |J d + r|² + damping·s²|d/scale|² with lower ≤ d ≤ upper.

    `scale` (k,) are the lengths in which steps are measured, and s is the largest singular value of J·scale.
    Combinations `held` (h, k) do not move: held·d vanishes.
    """
    free = lower < upper
    d = np.zeros(J.shape[1])
    if not free.any():
        return d
    still = np.zeros((0, int(free.sum()))) if held is None or not len(held) else orth((held * scale)[:, free].T).T
    scaled = J[:, free] * scale[free]
    scaled = scaled - (scaled @ still.T) @ still
    size = float(np.linalg.norm(scaled, 2)) or 1.0
    rows = np.vstack([scaled, np.sqrt(damping) * size * np.eye(scaled.shape[1]), _RIGID * size * still])
    target = np.concatenate([-r, np.zeros(len(rows) - len(r))])
    d[free] = scale[free] * bounded_least_squares(rows, target, lower[free] / scale[free], upper[free] / scale[free])
    return np.clip(d, lower, upper)


def without(scaled: Reals, held: Reals) -> Reals:
    """Rows (n, k) that are independent of combinations (h, k), which are fixed."""
    if not len(held):
        return scaled
    basis = orth(held.T)
    return np.asarray(scaled - (scaled @ basis) @ basis.T)


def bounded_least_squares(rows: Reals, target: Reals, lower: Reals, upper: Reals) -> Reals:
    """x that minimises |rows·x − target|² inside the bounds."""
    unbounded = np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0], dtype=float)
    if ((unbounded >= lower) & (unbounded <= upper)).all():
        return unbounded
    return lsq_linear(rows, target, bounds=(lower, upper), method="bvls", tol=1e-14, max_iter=20 * rows.shape[1]).x


LEAST = 1e-12
"""The least damping: combinations without any effect do not move, and all others move as if there were none."""


@dataclass(frozen=True, eq=False)
class LocalModel:
    """r + J d within the bounds; steps are measured in `scale`.

    `held` (h, k) are combinations v of which vᵀd must vanish.
    """

    residuals: Reals
    jacobian: Reals
    lower: Reals
    upper: Reals
    scale: Reals
    held: Reals

    @cached_property
    def compressed(self) -> tuple[Reals, Reals]:
        """Residuals and Jacobian by no more rows than there are parameters.

        The part of the residuals that no parameter changes is left out: it has no effect on a step but rounding.
        """
        n, k = self.jacobian.shape
        if n <= k:
            return self.residuals, self.jacobian
        rows = np.asarray(np.linalg.qr(np.column_stack([self.jacobian, self.residuals]), mode="r"))[:k]
        return rows[:, -1], rows[:, :-1]

    def without_leading(self, number: int) -> LocalModel:
        """The model without the combinations of parameters that have the largest effect, in `scale`."""
        residuals, jacobian = self.compressed
        u, s, vt = np.linalg.svd(jacobian * self.scale, full_matrices=False)
        s[:number] = 0.0
        return replace(self, residuals=residuals, jacobian=(u * s) @ vt / self.scale)

    def step(self, damping: float = LEAST) -> Reals:
        """The damped step, see `bounded_step`."""
        return bounded_step(*self.compressed, damping, self.lower, self.upper, self.scale, self.held)

    def gain(self, d: Reals) -> float:
        """Predicted decrease of ½rᵀr over d."""
        change = self.jacobian @ d
        return -float(change @ (self.residuals + 0.5 * change))


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

    def shorter(self, state: float, gain: float, rejected: int) -> float | None:
        """State after a rejected step; None ends the trials.

        Its gain is −∞ if it could not be solved; `rejected` is the number of steps rejected before it at this point.
        """
        ...

    def further(self, gain: float) -> float:
        """Factor by which an accepted step is lengthened for one more trial; 1 for no trial."""
        ...

    def corrected(self, local: LocalModel, d: Reals, state: float, error: Reals) -> Reals | None:
        """The step to try after d was rejected, which does without another state; None for none.

        `error` (n,) are the residuals at d less the linear ones.
        """
        ...


_MUCH_BETTER = 1.5
"""Gain ratio from which a step is lengthened: the objective fell by half more than the linear model predicts. Smaller
ratios are the usual error of that model."""
_MOST_LENGTHENED = 10.0
"""Largest factor on a step: one decade, so that a single lucky ratio does not leave the region of the linear model."""


def lengthened(gain: float) -> float:
    """Length of the best step along a line on which the curvature shows, relative to the step; one for small gains.

    With large residuals the true curvature can be much less than that of the linear model. The decrease then is up to
    twice the predicted one, and many steps of the same length would follow each other.
    """
    return min(1.0 / max(2.0 - gain, 1e-3), _MOST_LENGTHENED) if gain > _MUCH_BETTER else 1.0


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

    def shorter(self, state: float, gain: float, rejected: int) -> float | None:
        """None: this search does not offer it."""
        return None

    def further(self, gain: float) -> float:
        """The step is taken as it is."""
        return 1.0

    def corrected(self, local: LocalModel, d: Reals, state: float, error: Reals) -> Reals | None:
        """None: this search does not offer it."""
        return None


# ----------------------------------------------------------------------------------------------------
# Levenberg-Marquardt: damping that shortens and turns the step, the bounds inside it.


_MOST_DAMPING = 1e12
"""Damping from which a step changes no digit that counts, so that the search ends."""
_LEAST_AFTER_REJECTION = 1e-9
"""Damping after a rejected step; zero would stay zero when multiplied."""
_DAMPING_EXPONENT = 0.6
"""Exponent with which the damping follows the distance of the gain ratio from one. It trades fast decrease on good
steps for few rejected ones."""
_LEAST_ACCELERATION = 0.02
"""Second-order part relative to the step, below which it is not worth a solution."""
_MOST_ACCELERATION = 0.75
"""The same, above which the second-order expansion is not trusted (after Transtrum and Sethna 2012)."""


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
        """Less damping, the more the actual decrease agrees with the predicted one, and more if it does not."""
        factor = _factor(gain) if gain <= 1.0 else min(_factor(gain), 0.5)
        return max(max(factor, 0.1) * state, LEAST)

    def shorter(self, state: float, gain: float, rejected: int) -> float | None:
        """Two to ten times the damping, the more the objective has increased; after three rejections more and more.

        Damping that is small beside all curvatures must grow quickly to have any effect.
        """
        factor = min(max(_factor(gain), 2.0), 10.0) * 4.0 ** max(rejected - 2, 0)
        more = max(factor * state, _LEAST_AFTER_REJECTION)
        return more if more <= _MOST_DAMPING else None

    def further(self, gain: float) -> float:
        """See `lengthened`."""
        return lengthened(gain)

    def corrected(self, local: LocalModel, d: Reals, state: float, error: Reals) -> Reals | None:
        """The damped step again, from residuals that contain the error of the linear ones at d.

        In a curved valley a straight step leaves the bottom, and only very short ones decrease the objective. The error
        is half the second derivative along d; with it the step turns along the valley (Transtrum and Sethna 2012). It
        is worth no trial if it is nearly d, or differs from it by more than three quarters of d.
        """
        turned = replace(local, residuals=local.residuals + error).step(state)
        change, length = (float(np.linalg.norm(v / local.scale)) for v in (turned - d, d))
        return turned if _LEAST_ACCELERATION * length <= change <= _MOST_ACCELERATION * length else None


def _factor(gain: float) -> float:
    """By how much to multiply the damping: one where the decrease is three quarters of the predicted one.

    In a curved valley the right damping lies between one that is rejected and a tenth of it that is too much, so that
    fixed factors of ten would reject every second step.
    """
    return float((4.0 * abs(1.0 - gain)) ** _DAMPING_EXPONENT)


# ----------------------------------------------------------------------------------------------------
# Line search: the undamped step, halved until the objective falls.


_SHORTEST_STEP = 1e-10
"""Fraction of a Gauss-Newton step below which the line search ends."""


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

    def shorter(self, state: float, gain: float, rejected: int) -> float | None:
        """Half the step."""
        return 0.5 * state if state > _SHORTEST_STEP else None

    def further(self, gain: float) -> float:
        """See `lengthened`."""
        return lengthened(gain)

    def corrected(self, local: LocalModel, d: Reals, state: float, error: Reals) -> Reals | None:
        """None: this search does not offer it."""
        return None
