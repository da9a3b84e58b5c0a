"""Symmetric positive definite matrices: checks, factors, distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError

Reals = NDArray[np.float64]

_NEGATIVE = -1e-8


def check_positive(covariance: Reals, what: str, hint: str = "") -> None:
    """Refuse what is no covariance: asymmetric, not finite, or with a negative eigenvalue of its correlations.

    Raises
    ------
    FemtuneError : ``quantify.not-positive``
    """
    if np.isfinite(covariance).all() and np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0):
        lowest = least_eigenvalue(covariance)
        if lowest >= _NEGATIVE:
            return
        why, values = "is not positive definite", {"least eigenvalue of its correlations": f"{lowest:.3g}"}
    else:
        why, values = "is not symmetric, or has entries that are not finite", {}
    raise FemtuneError(
        "quantify.not-positive", f"{what} {why}", values=values,
        hint=hint or "check its entries: a correlation above one, or a covariance in another order than its outputs",
    )  # fmt: skip


def least_eigenvalue(covariance: Reals) -> float:
    """Least eigenvalue of the matrix scaled to a unit diagonal; negative where it is no covariance."""
    variance = np.diag(covariance)
    if (variance < 0.0).any():
        return -1.0
    sd = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    return float(np.linalg.eigvalsh(covariance / np.outer(sd, sd)).min(initial=0.0 if not len(sd) else np.inf))


def factor(covariance: Reals) -> Reals:
    """L with L Lᵀ = covariance, for semidefinite matrices too; (k, k), Cholesky's where that exists."""
    try:
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(covariance)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def correlation_of(covariance: Reals) -> Reals:
    """(k, k) correlations; zero beside what does not scatter."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(sd > 0.0, sd, 1.0)
    return np.asarray(covariance / np.outer(safe, safe))


def covariance_distance(reached: Reals, wanted: Reals) -> float:
    """|C − C₀|/|C₀| (Frobenius) after both are scaled by the wanted standard deviations."""
    sd = np.sqrt(np.diag(wanted))
    scale = np.outer(sd, sd)
    return float(np.linalg.norm((reached - wanted) / scale) / np.linalg.norm(wanted / scale))
