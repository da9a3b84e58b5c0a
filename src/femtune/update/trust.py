"""One bounded, damped least-squares step (Levenberg-Marquardt with the bounds inside the step)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import orth
from scipy.optimize import lsq_linear

from femtune.select import NO_EFFECT, determined

Reals = NDArray[np.float64]

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
    """Rows (n, k) that do not feel combinations (h, k), which are thereby known to hold still."""
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
