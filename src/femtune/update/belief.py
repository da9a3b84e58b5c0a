"""Belief: what is known of the parameters between two updates, and what an update makes of it.

Sources: A. Tarantola, Inverse Problem Theory, 2005, section 3.2; S. F. Schmidt, Application of State-Space Methods to
Navigation Problems, Advances in Control Systems 3, 1966 (parameters that are not estimated but considered).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from femtune.parameters import ParameterSet
from femtune.update.regularise import Prior
from femtune.update.result import UpdateResult

Reals = NDArray[np.float64]

_BY_CHANCE, _LEAST_FREEDOM = 0.01, 1e-3


@dataclass(frozen=True, eq=False)
class Belief:
    """Values and covariance of all free parameters.

    Parameters
    ----------
    x : (k,) normalised values
    covariance : (k, k) of x
    found : (k,) parameters that an update has found; the others are as the study believed them to be
    """

    parameters: ParameterSet
    x: Reals
    covariance: Reals
    found: NDArray[np.bool_]

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations in the parameters' units."""
        spread = np.sqrt(np.diag(self.covariance)) * self.parameters.scale
        return {p.name: float(s) for p, s in zip(self.parameters.free, spread)}

    @property
    def values(self) -> dict[str, float]:
        """Values of all parameters, tied ones too."""
        return self.parameters.values(self.x)

    def prior(self) -> Prior:
        """What is found, as the prior of the next update; other parameters keep their own."""
        at = np.flatnonzero(self.found)
        scale = self.parameters.scale[at]
        names = tuple(self.parameters.free[i].name for i in at)
        covariance = self.covariance[np.ix_(at, at)] * np.outer(scale, scale)
        return Prior(names, self.parameters.denormalise(self.x)[at], covariance)


def first_belief(parameters: ParameterSet) -> Belief:
    """The parameters' own nominal values and priors."""
    k = len(parameters.free)
    return Belief(parameters, np.zeros(k), np.diag(parameters.prior[1] ** 2), np.zeros(k, bool))


@dataclass(frozen=True)
class Misfit:
    """How large the residuals of one kind are beside what noise and uncertain parameters explain.

    Parameters
    ----------
    size : root of the sum of squares over its expectation: about 1
    large : True where chance exceeds it once in a hundred tests of a right model
    """

    size: float
    large: bool


@dataclass(frozen=True)
class Learned:
    """The belief after an update, and by kind of residual whether the data agree with it."""

    belief: Belief
    misfit: dict[str, Misfit]


def learned(before: Belief, result: UpdateResult) -> Learned:
    """The belief after an update that moved some parameters while the others rested where they were believed to be.

    With residuals r, Jacobian J of all parameters, and rows R of a prior, the update moves by −K r with
    K = (JₘᵀJₘ + RᵀR)⁻¹Jₘᵀ in the rows of what moved and zero in the others. So errors e before become (I − K J)e − K n
    with the noise n of the data: what rests and is uncertain makes what moves uncertain, and correlated with it. Where
    a kind of residual is larger than noise and all these errors explain, its noise counts as so much larger. A
    parameter at a bound counts as resting, and keeps its standard deviation.
    """
    moved = np.isin([p.name for p in before.parameters.free], result.active) & ~_at_bound(result)
    J = result.after.jacobian
    gain = np.zeros(J.T.shape)
    gain[moved] = _gain(J[:, moved], result.side.prior_rows[:, moved])
    turn = np.eye(len(moved)) - gain @ J
    old = turn @ before.covariance @ turn.T
    misfit = _misfit(result, J, gain, old + gain @ gain.T)
    noise = gain * [misfit[kind].size if misfit[kind].large else 1.0 for kind in result.after.kinds]
    covariance = old + noise @ noise.T
    after = Belief(before.parameters, result.x, 0.5 * (covariance + covariance.T), before.found | moved)
    return Learned(after, misfit)


def _at_bound(result: UpdateResult) -> NDArray[np.bool_]:
    return np.isin([p.name for p in result.parameters.free], result.history[-1].at_bound)


def _gain(J: Reals, prior: Reals) -> Reals:
    """(JᵀJ + RᵀR)⁻¹Jᵀ: pseudo-inverse where the data do not determine everything and no prior does."""
    inverse = np.linalg.pinv(np.vstack([J, prior]), rcond=1e-10)
    return np.asarray(inverse @ inverse.T @ J.T)


def _misfit(result: UpdateResult, J: Reals, gain: Reals, posterior: Reals) -> dict[str, Misfit]:
    """By kind; the residuals' covariance is I + U D Uᵀ with U = [J, Kᵀ] and D = [[P, −I], [−I, 0]], P the posterior."""
    kinds, one = np.asarray(result.after.kinds), -np.eye(len(posterior))
    D = np.block([[posterior, one], [one, np.zeros_like(one)]])
    U = np.hstack([J, gain.T])
    return {
        str(kind): _misfit_of(result.after.residuals[kinds == kind], U[kinds == kind], D) for kind in np.unique(kinds)
    }


def _misfit_of(r: Reals, U: Reals, D: Reals) -> Misfit:
    """Sum of squares beside its mean; its distribution is taken as that of χ² with the same mean and variance."""
    product = D @ (U.T @ U)
    mean = len(r) + float(np.trace(product))
    if mean < _LEAST_FREEDOM:
        return Misfit(1.0, False)
    freedom = mean**2 / (len(r) + 2.0 * float(np.trace(product)) + float(np.trace(product @ product)))
    ratio = float(r @ r) / mean
    return Misfit(float(np.sqrt(ratio)), bool(ratio * freedom > chi2.ppf(1.0 - _BY_CHANCE, freedom)))
