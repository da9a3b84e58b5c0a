"""Standard deviations of updated parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.select import determined

Reals = NDArray[np.float64]

_SHARE = 0.05


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance of x (k, k), NaN in rows and columns for which none is given, with the reason by position.

    `noise_factor` is the factor by which the residuals' own standard deviations were scaled: √(rᵀr/(n − k)), or the
    larger of that and one where the deviations come from the test.
    """

    matrix: Reals
    reasons: dict[int, str]
    noise_factor: float

    @property
    def sd(self) -> Reals:
        """(k,) standard deviations, NaN where none is given."""
        return np.sqrt(np.diag(self.matrix))


def parameter_covariance(
    r: Reals, J: Reals, extra: Reals, at_bound: NDArray[np.bool_], prior_sd: Reals, measured: bool
) -> ParameterCovariance:
    """Covariance (JᵀJ/s² + RᵀR)⁻¹ of the parameters that are not at a bound.

    Parameters
    ----------
    r, J : (n,), (n, k) residuals in units of their standard deviations, and Jacobian
    extra : (m, k) rows of a prior, (0, k) without
    at_bound : (k,) parameters at a bound get no standard deviation
    prior_sd : (k,) spreads that tell whether a parameter is determined
    measured : True where the residuals' deviations are measured scatter rather than weights
    """
    k = J.shape[1]
    free = np.flatnonzero(~at_bound)
    spare = len(r) - (len(free) if not len(extra) else 0)
    factor = _noise_factor(float(r @ r), spare, measured)
    matrix = np.full((k, k), np.nan)
    reasons = {int(i): "at bound, σ not given" for i in np.flatnonzero(at_bound)}
    if not np.isfinite(factor):
        return ParameterCovariance(matrix, reasons | {int(i): "no spare residuals, σ not given" for i in free}, factor)
    rows = np.vstack([J[:, free] / max(factor, 1e-300), extra[:, free]])
    known, covariance = _inverse(rows, prior_sd[free])
    for a, i in enumerate(free):
        if not known[a]:
            reasons[int(i)] = "not determined by the data, σ not given"
    some = free[known]
    matrix[np.ix_(some, some)] = covariance[np.ix_(known, known)]
    return ParameterCovariance(matrix, reasons, factor)


def _noise_factor(squares: float, spare: int, measured: bool) -> float:
    """How much larger the residuals are than their standard deviations say; NaN where nothing tells."""
    if spare <= 0:
        return 1.0 if measured else float("nan")
    factor = float(np.sqrt(squares / spare))
    return max(factor, 1.0) if measured else factor


def _inverse(rows: Reals, prior_sd: Reals) -> tuple[NDArray[np.bool_], Reals]:
    """Which parameters have no share in what the rows leave undetermined, and (rowsᵀrows)⁻¹ on the rest."""
    k = rows.shape[1]
    padded = np.vstack([rows * prior_sd, np.zeros((max(0, k - len(rows)), k))])
    _, s, vt = np.linalg.svd(padded, full_matrices=False)
    good = determined(s)
    share = np.linalg.norm(vt[~good], axis=0)
    inverse = (vt[good].T / s[good] ** 2) @ vt[good]
    return share < _SHARE, inverse * np.outer(prior_sd, prior_sd)
