"""A Gaussian prior of the parameters: the update becomes a maximum a posteriori estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.parameters import ParameterSet
from femtune.updating.regularisation import LinearModel, SideConstraint, position

_LARGEST_ASYMMETRY = 1e-8
"""Difference of r_ij and r_ji that is still rounding of numbers written by hand or by a program: half of the digits."""
_LEAST_EIGENVALUE = 1e-13
"""Eigenvalue of a correlation matrix at or below which it is singular to the rounding of a double."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Rows L⁻¹(P − mean) with LLᵀ the covariance.

    Parameters
    ----------
    names : free parameters that mean and covariance are about, in their order; all other free parameters keep the mean
        and standard deviation that they have themselves, and so do all where no name is given
    mean, covariance : (m,) and (m, m), in the parameters' units

    Raises
    ------
    FemtuneError : ``prior.shape``, ``prior.zero-variance`` or ``prior.not-positive-definite``
    """

    names: tuple[str, ...] = ()
    mean: Reals | Sequence[float] = ()
    covariance: Reals | Sequence[Sequence[float]] = ()

    def __post_init__(self) -> None:
        mean = np.asarray(self.mean, dtype=float).reshape(-1)
        covariance = np.asarray(self.covariance, dtype=float)
        m = len(self.names)
        if mean.shape != (m,) or covariance.size != m * m or len(set(self.names)) < m:
            raise _shape(self.names, mean, covariance)
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", covariance.reshape(m, m))
        check_covariance(self.names, covariance.reshape(m, m))

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of all free parameters; those that rest count as known, so that correlated ones follow them.

        Raises
        ------
        FemtuneError : ``update.unknown-parameter``, ``prior.outside-bounds``
        """
        mean, covariance = self._normalised(at.parameters)
        check_mean(at.parameters, mean)
        rows = la.solve_triangular(la.cholesky(covariance, lower=True), np.eye(len(mean)), lower=True)
        return SideConstraint("prior", rows, rows @ mean, informative=True)

    def _normalised(self, parameters: ParameterSet) -> tuple[Reals, Reals]:
        """Mean and covariance of x."""
        prior_mean, sd = parameters.prior
        mean, covariance = np.array(prior_mean), np.diag(sd**2)
        at = [position(parameters, name) for name in self.names]
        scale = parameters.scale[at]
        mean[at] = (np.asarray(self.mean) - parameters.nominal[at]) / scale
        covariance[np.ix_(at, at)] = np.asarray(self.covariance) / np.outer(scale, scale)
        return mean, covariance


def correlated_prior(parameters: ParameterSet, correlations: Sequence[tuple[str, str, float]]) -> Prior:
    """The parameters' own means and standard deviations with correlations between pairs of them.

    Raises
    ------
    FemtuneError : ``update.unknown-parameter``, ``prior.not-positive-definite``
    """
    correlation = np.eye(len(parameters.free))
    for one, other, value in correlations:
        i, j = position(parameters, one), position(parameters, other)
        correlation[i, j] = correlation[j, i] = value
    sd = np.array([p.sd for p in parameters.free])
    mean = [p.mean for p in parameters.free]
    return Prior(tuple(p.name for p in parameters.free), mean, correlation * np.outer(sd, sd))


def check_covariance(names: Sequence[str], covariance: Reals) -> None:
    """Refuse what is no covariance of these parameters (errors ``prior.*``)."""
    variances = np.diag(covariance)
    flat = [name for name, v in zip(names, variances) if v <= 0.0]
    if flat:
        raise FemtuneError(
            "prior.zero-variance",
            values={"variances": ", ".join(f"{v:g}" for v in variances)},
            parameters=", ".join(flat),
        )
    if not np.isfinite(covariance).all():
        raise _shape(names, variances, covariance)
    sd = np.sqrt(variances)
    correlation = covariance / np.outer(sd, sd)
    least = float(la.eigvalsh(0.5 * (correlation + correlation.T)).min(initial=1.0))
    if np.abs(correlation - correlation.T).max(initial=0.0) > _LARGEST_ASYMMETRY or least <= _LEAST_EIGENVALUE:
        raise _not_positive(names, correlation, least)


def check_mean(parameters: ParameterSet, mean: Reals) -> None:
    """Refuse a mean that the bounds exclude (error ``prior.outside-bounds``)."""
    lower, upper = parameters.bounds
    slack = 1e-9 * (upper - lower)
    for i in np.flatnonzero(~((mean >= lower - slack) & (mean <= upper + slack))):
        p = parameters.free[i]
        raise FemtuneError(
            "prior.outside-bounds",
            where=p.where,
            values={"mean": float(parameters.denormalise(mean)[i]), "lower": p.lower, "upper": p.upper},
            parameter=p.name,
        )


def _not_positive(names: Sequence[str], correlation: Reals, least: float) -> FemtuneError:
    off = np.abs(correlation - np.eye(len(correlation)))
    i, j = divmod(int(np.argmax(off)), len(off))
    return FemtuneError(
        "prior.not-positive-definite",
        values={
            "parameters": ", ".join(names),
            "smallest eigenvalue of its correlation matrix": f"{least:.3g}",
            "largest correlation": f"{correlation[i, j]:.4g} between {names[i]} and {names[j]}",
        },
    )


def _shape(names: Sequence[str], mean: Reals, covariance: Reals) -> FemtuneError:
    return FemtuneError(
        "prior.shape", values={"parameters": ", ".join(names), "means": len(mean), "covariance": str(covariance.shape)}
    )
