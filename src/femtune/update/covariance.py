"""Standard deviations of updated parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.select import determined

Reals = NDArray[np.float64]

_SHARE = 0.05


@dataclass(frozen=True)
class ParameterCovariance:
    """Covariance of x (k, k), NaN in rows and columns for which none is given, with the reason by position.

    `misfit` is, by kind of residual, the root mean square of the residuals in units of their stated standard
    deviations, freed of the parameters' share: 1 where the data scatter as they were said to.
    """

    matrix: Reals
    reasons: dict[int, str]
    misfit: dict[str, float]

    @property
    def sd(self) -> Reals:
        """(k,) standard deviations, NaN where none is given."""
        return np.sqrt(np.diag(self.matrix))


def parameter_covariance(
    r: Reals,
    J: Reals,
    kinds: Sequence[str],
    extra: Reals,
    at_bound: NDArray[np.bool_],
    prior_sd: Reals,
    moving: NDArray[np.bool_] | None = None,
) -> ParameterCovariance:
    """Covariance of the least-squares estimate, H⁻¹(JᵀS²J + RᵀR)H⁻¹ with H = JᵀJ + RᵀR, of parameters not at a bound.

    S holds the misfit of each row's kind where that is above one: a kind that fits worse than stated widens the
    result, and none that fits better narrows it (a loose deviation of shapes says nothing of the frequencies).

    Parameters
    ----------
    r, J : (n,), (n, k) residuals in units of their standard deviations, and Jacobian
    kinds : (n,) kind of each residual
    extra : (m, k) rows R of a prior, (0, k) without
    at_bound : (k,) parameters at a bound get no standard deviation
    prior_sd : (k,) spreads that tell whether a parameter is determined
    moving : (k,) parameters that the update moves, all where it is None; the others get no standard deviation
    """
    k = J.shape[1]
    moving = np.ones(k, bool) if moving is None else moving
    free = np.flatnonzero(moving & ~at_bound)
    matrix = np.full((k, k), np.nan)
    reasons = {int(i): "not moved by this update, σ not given" for i in np.flatnonzero(~moving)}
    reasons |= {int(i): "at bound, σ not given" for i in np.flatnonzero(at_bound)}
    rows = np.vstack([J, extra])[:, free] * prior_sd[free]
    s, vt = _directions(rows)
    good = determined(s) if not len(extra) else s > 0.0
    known = np.linalg.norm(vt[~good], axis=0) < _SHARE
    misfit = _misfit(r, kinds, 0 if len(extra) else int(good.sum()))
    reasons |= {int(i): "not determined by the data, σ not given" for i in free[~known]}
    scatter = np.concatenate([np.maximum([misfit[kind] for kind in kinds], 1.0), np.ones(len(extra))])
    estimator = (vt[good].T / s[good] ** 2) @ vt[good] @ rows.T * scatter
    covariance = estimator @ estimator.T * np.outer(prior_sd[free], prior_sd[free])
    matrix[np.ix_(free[known], free[known])] = covariance[np.ix_(known, known)]
    return ParameterCovariance(matrix, reasons, misfit)


def _misfit(r: Reals, kinds: Sequence[str], fitted: int) -> dict[str, float]:
    """Root mean square by kind; each kind pays for the fitted combinations in proportion to its rows."""
    share = 1.0 - fitted / len(r) if len(r) > fitted else 1.0
    names = np.asarray(kinds)
    return {kind: float(np.sqrt(np.mean(r[names == kind] ** 2) / share)) for kind in dict.fromkeys(kinds)}


def _directions(rows: Reals) -> tuple[Reals, Reals]:
    k = rows.shape[1]
    _, s, vt = np.linalg.svd(np.vstack([rows, np.zeros((max(0, k - len(rows)), k))]), full_matrices=False)
    return s, vt
