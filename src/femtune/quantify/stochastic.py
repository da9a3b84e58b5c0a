"""Stochastic model updating: mean and covariance of parameters from mean and covariance of measured outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.quantify.cloud import CloudRules, CloudStep, update_cloud
from femtune.quantify.covariance_matrix import check_positive, correlation_of
from femtune.quantify.estimator import Estimator, Weighting, estimator
from femtune.quantify.means import Means, MeanStep, update_means
from femtune.quantify.outputs import Counted, Outputs
from femtune.quantify.repeats import OutputStatistics
from femtune.quantify.second_order import corrected, quadratic_model
from femtune.quantify.status import StochasticStatus

Reals = NDArray[np.float64]
Method = Literal["perturbation", "cross-covariance", "output-difference", "second-order"]


@dataclass(frozen=True)
class StochasticRules:
    """How a stochastic update goes.

    Parameters
    ----------
    method : of the covariance. "perturbation" is chapter equation (39), "cross-covariance" (40), "output-difference"
        (41), "second-order" is (39) with the curvature of the outputs taken into account
    weighting, regularisation : of the estimator, see `estimator`
    max_iterations, tolerance : of the means, see `update_means`
    cloud : of (40) and (41)
    """

    method: Method = "second-order"
    weighting: Weighting = "relative"
    regularisation: float = 0.0
    max_iterations: int = 50
    tolerance: float = 1e-6
    cloud: CloudRules = field(default_factory=CloudRules)


@dataclass(frozen=True)
class StochasticResult:
    """Distribution of the parameters.

    Parameters
    ----------
    names : (k,) parameters
    mean, covariance : (k,), (k, k) in their own units
    start, start_sd : (k,) where the update began
    T : (k, m) of the last step
    steps : the iteration of the means, or of the clouds
    solutions : model solutions, the update of the means included
    unexplained : share of the outputs' variance that no choice of these parameters reaches, to first order
    """

    names: tuple[str, ...]
    mean: Reals
    covariance: Reals
    start: Reals
    start_sd: Reals
    measured: OutputStatistics
    T: Reals
    G: Reals
    steps: tuple[MeanStep | CloudStep, ...]
    solutions: int
    status: StochasticStatus
    rules: StochasticRules
    unexplained: float

    @property
    def sd(self) -> Reals:
        """(k,) standard deviations."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def correlation(self) -> Reals:
        """(k, k)."""
        return correlation_of(self.covariance)

    @property
    def citations(self) -> tuple[str, ...]:
        """Keys of `femtune.citations`."""
        own = {"cross-covariance": ("khodaparast2008",), "output-difference": ("govers2010",)}
        return ("mottershead2011", "silva2016", *own.get(self.rules.method, ()))


def stochastic_update(
    outputs: Outputs,
    measured: OutputStatistics,
    names: Sequence[str],
    start: Reals,
    start_sd: Reals,
    rules: StochasticRules = StochasticRules(),
) -> StochasticResult:
    """Mean and covariance of k parameters for which the outputs scatter as they were measured.

    Parameters
    ----------
    outputs : model, in the units of `measured`
    measured : m outputs
    start, start_sd : (k,) first means and standard deviations; the standard deviations are the units in which steps
        are measured, in which a regularisation weighs, and of the first cloud

    Raises
    ------
    FemtuneError : ``quantify.size``, ``quantify.start-sd``, ``quantify.singular``, ``quantify.zero-mean``,
        ``quantify.not-finite``, and what the model raises at the start
    """  # fmt: skip
    start, start_sd = np.asarray(start, float), np.asarray(start_sd, float)
    _check_start(tuple(names), start, start_sd)
    by = estimator(measured, start_sd, rules.weighting, rules.regularisation)
    counted = Counted(outputs)
    _check_outputs(counted, measured, start)
    if rules.method in ("cross-covariance", "output-difference"):
        found = _by_cloud(counted, measured, by, start, start_sd, rules)
    else:
        found = _by_means(counted, measured, by, start, rules)
    G = counted.linearised(found.mean)[1] if found.G is None else found.G
    return StochasticResult(
        tuple(names), found.mean, found.covariance, start, start_sd, measured, found.T, G, found.steps,
        found.solutions, found.status, rules, unexplained(G, measured),
    )  # fmt: skip


@dataclass(frozen=True)
class _Found:
    mean: Reals
    covariance: Reals
    T: Reals
    G: Reals | None
    steps: tuple[MeanStep | CloudStep, ...]
    status: StochasticStatus
    solutions: int


def _by_means(
    counted: Counted, measured: OutputStatistics, by: Estimator, start: Reals, rules: StochasticRules
) -> _Found:
    at = update_means(counted, measured.mean, start, by, rules.max_iterations, rules.tolerance)
    moments, status = (at.theta, at.T @ measured.covariance @ at.T.T), at.status
    if rules.method == "second-order" and status.ok:
        moments, status = _second_order(counted, measured, by, at, moments)
    return _Found(*moments, at.T, at.G, at.steps, status, counted.solutions)


def _second_order(
    counted: Counted, measured: OutputStatistics, by: Estimator, at: Means, linear: tuple[Reals, Reals]
) -> tuple[tuple[Reals, Reals], StochasticStatus]:
    better = corrected(quadratic_model(counted, at, by.scale), measured, by)
    return (linear, StochasticStatus.TOO_CURVED) if better is None else (better, at.status)


def _by_cloud(
    counted: Counted, measured: OutputStatistics, by: Estimator, start: Reals, sd: Reals, rules: StochasticRules
) -> _Found:
    formula: Literal["cross-covariance", "output-difference"] = (
        "cross-covariance" if rules.method == "cross-covariance" else "output-difference"
    )
    found = update_cloud(counted, measured, start, np.diag(sd**2), by, formula, rules.cloud)
    last = found.steps[-1]
    return _Found(last.mean, last.covariance, found.T, None, found.steps, found.status, counted.solutions)


def unexplained(G: Reals, measured: OutputStatistics) -> float:
    """Share of the outputs' variance outside the range of G, to first order; zero for a square G of full rank.

    A set of parameters that is not the one that scatters can still meet the mean; here it shows. Outputs are scaled by
    their means, as their weights are, and variances are summed over all of them.
    """
    scale = np.where(measured.mean != 0.0, np.abs(measured.mean), 1.0)
    u, s, _ = np.linalg.svd(G / scale[:, None], full_matrices=False)
    u = u[:, s > 1e-8 * s.max(initial=0.0)]
    C = measured.covariance / np.outer(scale, scale)
    return max(0.0, 1.0 - float(np.trace(u.T @ C @ u) / np.trace(C)))


def _check_start(names: tuple[str, ...], start: Reals, sd: Reals) -> None:
    if not len(names) == len(start) == len(sd):
        raise FemtuneError(
            "quantify.size",
            "names, means and standard deviations of the parameters are not equally many",
            values={"names": len(names), "means": len(start), "standard deviations": len(sd)},
            hint="give one of each for every parameter",
        )
    if not (np.isfinite(sd) & (sd > 0.0)).all():
        i = int(np.argmin(np.where(np.isfinite(sd), sd, -np.inf)))
        raise FemtuneError(
            "quantify.start-sd",
            f"the standard deviation of {names[i]} at the start is not positive",
            values={"standard deviation": sd[i]},
            hint="give a positive one: steps are measured in it",
        )
    check_positive(np.diag(sd**2), "the covariance of the parameters at the start")


def _check_outputs(counted: Counted, measured: OutputStatistics, start: Reals) -> None:
    found = len(counted.linearised(start)[0])
    if found != len(measured.mean):
        raise FemtuneError(
            "quantify.size",
            "the model predicts another number of outputs than were measured",
            values={"predicted": found, "measured": len(measured.mean)},
            hint="give one column of repeats for each output, in the same order",
        )
