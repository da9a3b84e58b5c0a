"""Weights: how well it is known what is compared, by standard deviations or by a covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike, NDArray

from femtune.errors import FemtuneError
from femtune.residuals.block import ResidualBlock

Reals = NDArray[np.float64]

DEFINITE = 1e-12
"""Least eigenvalue of a correlation matrix over its largest one, below which it counts as singular."""


@dataclass(frozen=True, eq=False)
class Weights:
    """Scatter of n values, in their unit: `sd` (one for all, or (n,)) or `covariance` (n, n), one of the two.

    Residuals are r = L⁻¹e with LLᵀ the covariance (Cholesky), so that their own covariance is the identity.

    Raises
    ------
    FemtuneError : ``residual.weights`` for both, none, or what is no matrix; ``residual.zero-variance``;
        ``residual.covariance`` where the matrix is not symmetric and positive definite
    """

    sd: ArrayLike | None = None
    covariance: ArrayLike | None = None

    def __post_init__(self) -> None:
        if (self.sd is None) == (self.covariance is None):
            hint = "give sd, or covariance, one of the two"
            raise FemtuneError("residual.weights", "a residual is weighted by sd or by covariance", hint=hint)
        if self.covariance is None:
            _check_sd(np.asarray(self.sd, dtype=float))
        else:
            _check_covariance(np.asarray(self.covariance, dtype=float))

    def of(self, keep: ArrayLike) -> Weights:
        """Of some of the values, by position."""
        at = np.asarray(keep, dtype=int)
        if self.covariance is not None:
            return Weights(covariance=np.asarray(self.covariance, dtype=float)[np.ix_(at, at)])
        sd = np.asarray(self.sd, dtype=float)
        return self if sd.ndim == 0 else Weights(sd[at])

    @property
    def size(self) -> int | None:
        """n; None for one standard deviation that holds for any number of values."""
        matrix = np.asarray(self.sd if self.covariance is None else self.covariance)
        return None if matrix.ndim == 0 else len(matrix)

    def check_size(self, n: int, what: str) -> None:
        """Refuse weights for another number of values (error ``residual.weights``)."""
        if self.size not in (None, n):
            raise FemtuneError(
                "residual.weights",
                f"the weights are for {self.size} values, and {n} are compared: {what}",
                hint="give a standard deviation, or a row and a column of the covariance, for each of them, in order",
            )

    def whiten(self, errors: Reals, jacobian: Reals) -> tuple[Reals, Reals]:
        """Residuals (n,) and Jacobian (n, k) of errors in their unit."""
        if self.covariance is None:
            sd = np.broadcast_to(np.asarray(self.sd, dtype=float), errors.shape)
            return errors / sd, jacobian / sd[:, None]
        lower = la.cholesky(np.asarray(self.covariance, dtype=float), lower=True)
        both = la.solve_triangular(lower, np.column_stack([errors, jacobian]), lower=True)
        return both[:, 0], both[:, 1:]

    @property
    def scale(self) -> float:
        """Root mean square of the standard deviations."""
        if self.covariance is not None:
            return float(np.sqrt(np.mean(np.diag(np.asarray(self.covariance, dtype=float)))))
        return float(np.sqrt(np.mean(np.asarray(self.sd, dtype=float) ** 2)))


def weighted_block(
    kind: str, configuration: str, label: str, errors: Reals, jacobian: Reals, weights: Weights, size: float = 1.0
) -> ResidualBlock:
    """A block of errors in their unit; its `sd` is relative to `size`, the size of what is compared."""
    values, slopes = weights.whiten(errors, jacobian)
    return ResidualBlock(kind, configuration, label, values, slopes, weights.scale / (size or 1.0))


def as_weights(given: float | Weights) -> Weights:
    """A number is a standard deviation."""
    return given if isinstance(given, Weights) else Weights(given)


def _check_sd(sd: Reals) -> None:
    if sd.ndim > 1 or not np.isfinite(sd).all() or (sd < 0.0).any():
        raise FemtuneError(
            "residual.weights", "standard deviations must be finite and not negative", values={"sd": sd.tolist()},
            hint="give the scatter of the test in the unit of what is compared",
        )  # fmt: skip
    if (sd == 0.0).any():
        raise _zero("standard deviation", int(np.argmin(sd)), sd.ndim)


def _check_covariance(matrix: Reals) -> None:
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not np.isfinite(matrix).all():
        raise FemtuneError(
            "residual.weights", "a covariance is a square matrix of finite numbers",
            values={"shape": matrix.shape}, hint="give a row and a column for each value that is compared",
        )  # fmt: skip
    variances = np.diag(matrix)
    if (variances == 0.0).any():
        raise _zero("variance", int(np.argmin(np.abs(variances))), 1)
    if (variances < 0.0).any() or not np.allclose(matrix, matrix.T, rtol=1e-8, atol=0.0):
        raise _not_definite("it is not symmetric" if (variances > 0.0).all() else "it has a negative variance")
    root = np.sqrt(variances)
    found = la.eigvalsh(matrix / np.outer(root, root))
    if found.size and found[0] <= DEFINITE * found[-1]:
        raise _not_definite(f"the least eigenvalue of its correlations is {found[0]:.2g}")


def _not_definite(why: str) -> FemtuneError:
    return FemtuneError(
        "residual.covariance",
        f"the covariance is not symmetric and positive definite: {why}",
        hint="estimate it from more repeats than there are values, or give standard deviations",
    )


def _zero(what: str, position: int, dimensions: int) -> FemtuneError:
    place = f" of value {position + 1}" if dimensions else ""
    return FemtuneError(
        "residual.zero-variance",
        f"the {what}{place} is zero: nothing is known without scatter, and its weight would be infinite",
        hint="give the scatter that the test has, or leave this value out",
    )
