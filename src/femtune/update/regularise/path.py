"""The path of the parameters over the weight μ of a side constraint, on the linear model of the first iteration."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.update.regularise.choice import RegularisationPath
from femtune.update.regularise.side import LinearModel, SideConstraint

Reals = NDArray[np.float64]

POINTS = 301
_BEYOND, _LEAST = 30.0, 1e-9


def regularisation_path(side: SideConstraint, at: LinearModel, weights: Reals | None = None) -> RegularisationPath:
    """The path for given weights (m,), or for some that span all that the singular values tell apart.

    Source: Hansen (1992), Golub, Heath and Wahba (1979).
    """
    J, R = at.jacobian[:, at.moving], side.matrix[:, at.moving]
    offset = side.matrix @ at.x - side.target
    mu = _weights(J, R) if weights is None else np.asarray(weights, dtype=float)
    basis, triangle = np.linalg.qr(J)
    inside = basis.T @ at.residuals
    outside = float(np.linalg.norm(at.residuals - basis @ inside))
    points = [_point(triangle, R, inside, offset, m) for m in mu]
    d = np.array([p[0] for p in points]).reshape(len(mu), -1)
    rho = np.hypot(np.linalg.norm(inside + d @ triangle.T, axis=1), outside)
    eta = np.linalg.norm(offset + d @ R.T, axis=1)
    spare = len(at.residuals) - np.array([p[1] for p in points])
    changes = np.zeros((len(mu), len(at.x)))
    changes[:, at.moving] = d
    with np.errstate(divide="ignore"):
        crossed = np.where(spare > _LEAST, rho**2 / np.maximum(spare, _LEAST) ** 2, np.inf)
    return RegularisationPath(mu, changes, rho, eta, curvature(mu, rho, eta), crossed)


def _weights(J: Reals, R: Reals) -> Reals:
    """Weights from below the least to above the largest singular value of the data in units of the constraint."""
    s = np.linalg.svd(J @ np.linalg.pinv(R), compute_uv=False) if R.size else np.zeros(0)
    felt = s[s > _LEAST * s.max(initial=0.0)]
    least, most = (felt.min(), felt.max()) if felt.size else (1.0, 1.0)
    return np.geomspace(least / _BEYOND, most * _BEYOND, POINTS)


def _point(triangle: Reals, R: Reals, inside: Reals, offset: Reals, mu: float) -> tuple[Reals, float]:
    """d and the trace of the influence matrix."""
    rows = np.vstack([triangle, mu * R])
    inverse = la.pinv(rows, rtol=1e-14)
    d = -inverse @ np.concatenate([inside, mu * offset])
    return d, float(np.trace(triangle @ inverse[:, : len(triangle)]))


def curvature(mu: Reals, rho: Reals, eta: Reals) -> Reals:
    """Curvature of (log ρ, log η), positive where the curve turns like the corner of an L as μ rises."""
    if not (rho > 0.0).all() or not (eta > 0.0).all() or len(mu) < 5:
        return np.full(len(mu), np.nan)
    t = np.log(mu)
    x, y = np.log(rho), np.log(eta)
    dx, dy = np.gradient(x, t), np.gradient(y, t)
    speed = np.hypot(dx, dy)
    turn = dx * np.gradient(dy, t) - dy * np.gradient(dx, t)
    moving = speed > 1e-3 * speed.max()
    return np.where(moving, turn / np.where(moving, speed, 1.0) ** 3, np.nan)
