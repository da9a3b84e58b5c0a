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
    matrix = np.full((k, k), np.nan)
    reasons = {int(i): "at bound, σ not given" for i in np.flatnonzero(at_bound)}
    known, rank = _determined(np.vstack([J, extra])[:, free] * prior_sd[free])
    factor = _noise_factor(float(r @ r), len(r) - (0 if len(extra) else rank), measured)
    reasons |= {int(i): "not determined by the data, σ not given" for i in free[~known]}
    if not np.isfinite(factor):
        reasons |= {int(i): "no spare residuals, σ not given" for i in free[known]}
        return ParameterCovariance(matrix, reasons, factor)
    covariance = _inverse(J[:, free], extra[:, free], factor, prior_sd[free])
    matrix[np.ix_(free[known], free[known])] = covariance[np.ix_(known, known)]
    return ParameterCovariance(matrix, reasons, factor)


def _determined(scaled: Reals) -> tuple[NDArray[np.bool_], int]:
    """Which parameters have no share in what the rows leave undetermined, and how many combinations they determine."""
    s, vt = _directions(scaled)
    good = determined(s)
    return np.linalg.norm(vt[~good], axis=0) < _SHARE, int(good.sum())


def _directions(rows: Reals) -> tuple[Reals, Reals]:
    k = rows.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([rows, np.zeros((max(0, k - len(rows)), k))]), full_matrices=False)
    return s, vt


def _noise_factor(squares: float, spare: int, measured: bool) -> float:
    """How much larger the residuals are than their standard deviations say; NaN where nothing tells."""
    if spare <= 0:
        return 1.0 if measured else float("nan")
    factor = float(np.sqrt(squares / spare))
    return max(factor, 1.0) if measured else factor


def _inverse(J: Reals, extra: Reals, factor: float, prior_sd: Reals) -> Reals:
    """(JᵀJ/s² + RᵀR)⁻¹ on the combinations that are determined."""
    # s is taken out of the rows, since it may be zero: s² (JᵀJ + s² RᵀR)⁻¹
    s, vt = _directions(np.vstack([J, factor * extra]) * prior_sd)
    good = determined(s) if not len(extra) else s > 0.0
    inverse = (vt[good].T / s[good] ** 2) @ vt[good]
    return factor**2 * inverse * np.outer(prior_sd, prior_sd)
