"""One bounded, damped least-squares step (Levenberg-Marquardt with the bounds inside the step)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

Reals = NDArray[np.float64]


def bounded_step(r: Reals, J: Reals, damping: float, lower: Reals, upper: Reals) -> Reals:
    """d that minimises |J d + r|² + damping·|D d|² with lower ≤ d ≤ upper.

    D holds the norms of the Jacobian's columns (Marquardt's scaling), kept away from zero so that directions without
    any effect stay put: the solution of least change among equals.
    """
    norms = np.linalg.norm(J, axis=0)
    D = np.maximum(norms, 1e-3 * (norms.max(initial=0.0) or 1.0))
    rows = np.vstack([J, np.sqrt(damping) * np.diag(D)])
    target = np.concatenate([-r, np.zeros(len(D))])
    free = lower < upper
    d = np.zeros(len(D))
    if free.any():
        d[free] = _solve(rows[:, free] / D[free], target, lower[free] * D[free], upper[free] * D[free]) / D[free]
    return np.clip(d, lower, upper)


def _solve(rows: Reals, target: Reals, lower: Reals, upper: Reals) -> Reals:
    unbounded = np.asarray(np.linalg.lstsq(rows, target, rcond=None)[0], dtype=float)
    if ((unbounded >= lower) & (unbounded <= upper)).all():
        return unbounded
    return lsq_linear(rows, target, bounds=(lower, upper), method="bvls", tol=1e-14, max_iter=20 * rows.shape[1]).x


def projected_gradient(gradient: Reals, x: Reals, lower: Reals, upper: Reals) -> Reals:
    """The gradient without components that push against a bound where x already is."""
    blocked = ((x <= lower) & (gradient > 0.0)) | ((x >= upper) & (gradient < 0.0))
    return np.where(blocked, 0.0, gradient)
