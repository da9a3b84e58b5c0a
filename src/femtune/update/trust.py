"""One bounded, damped least-squares step (Levenberg-Marquardt with the bounds inside the step)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from femtune.select import determined

Reals = NDArray[np.float64]


def bounded_step(r: Reals, J: Reals, damping: float, lower: Reals, upper: Reals, spread: Reals) -> Reals:
    """d that minimises |J d + r|² + damping·s²|d/spread|² with lower ≤ d ≤ upper.

    `spread` (k,) are the parameters' prior standard deviations, in which steps are measured, and s is the largest
    singular value of J·spread. Combinations that the data do not determine stay where they are.
    """
    free = lower < upper
    d = np.zeros(J.shape[1])
    if not free.any():
        return d
    scaled = J[:, free] * spread[free]
    still, size = undetermined_directions(scaled)
    rows = np.vstack([scaled, np.sqrt(damping) * size * np.eye(scaled.shape[1]), size * still])
    target = np.concatenate([-r, np.zeros(len(rows) - len(r))])
    d[free] = spread[free] * _solve(rows, target, lower[free] / spread[free], upper[free] / spread[free])
    return np.clip(d, lower, upper)


def undetermined_directions(scaled: Reals) -> tuple[Reals, float]:
    """(m, k) unit vectors of combinations that a scaled Jacobian does not determine, and its largest singular value."""
    _, s, vt = np.linalg.svd(scaled)
    s = np.concatenate([s, np.zeros(len(vt) - len(s))])
    return vt[~determined(s)], float(s.max(initial=0.0)) or 1.0


def _solve(rows: Reals, target: Reals, lower: Reals, upper: Reals) -> Reals:
    unbounded = np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0], dtype=float)
    if ((unbounded >= lower) & (unbounded <= upper)).all():
        return unbounded
    return lsq_linear(rows, target, bounds=(lower, upper), method="bvls", tol=1e-14, max_iter=20 * rows.shape[1]).x


def projected_gradient(gradient: Reals, x: Reals, lower: Reals, upper: Reals) -> Reals:
    """The gradient without components that push against a bound where x already is."""
    blocked = ((x <= lower) & (gradient > 0.0)) | ((x >= upper) & (gradient < 0.0))
    return np.where(blocked, 0.0, gradient)
