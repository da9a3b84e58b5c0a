"""Stochastic model updating: mean and covariance of parameters from mean and covariance of measured outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Literal

import numpy as np
from scipy.special import ndtri

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.uncertainty.kinds import QUANTIFY_METHODS, OutputWeighting, QuantifyMethod
from femtune.uncertainty.outputs import Counted, Outputs, second_derivatives
from femtune.uncertainty.repeats import OutputStatistics, check_positive, correlation_of, factor, least_eigenvalue

# ----------------------------------------------------------------------------------------------------
# How a stochastic update ended.


class StochasticStatus(Enum):
    """Outcome; `ok` states whether mean and covariance may be used."""

    CONVERGED = "converged; means and covariance are stationary"
    UNDETERMINED = (
        "converged, but the outputs do not determine all parameters; the solution nearest to the initial values is used"
    )
    MEANS_LIMIT = "stopped at the iteration limit before the means converged; the last means are kept"
    CLOUD_LIMIT = "stopped at the iteration limit before the samples converged; the last samples are kept"
    MEANS_STALLED = "stopped because no step of any length reduces the error of the means; the best means are kept"
    TOO_CURVED = "the outputs are too nonlinear for the second-order correction; the result of equation (39) is kept"
    NOT_POSITIVE = "stopped because a step gave a covariance that is not positive definite; the last valid one is kept"

    @property
    def ok(self) -> bool:
        """True if the iteration converged."""
        return self in (StochasticStatus.CONVERGED, StochasticStatus.UNDETERMINED)


# ----------------------------------------------------------------------------------------------------
# The transformation T that takes changes of outputs to changes of parameters, chapter equations (22) and (36).


_RANK = 1e-8
"""Singular value relative to the largest, below which the outputs do not determine a combination: half of the digits of
a double."""


@dataclass(frozen=True)
class LinearEstimator:
    """T = (GᵀWG + μ²W_θ)⁻¹GᵀW, through a singular value decomposition of the stacked and scaled matrix.

    Parameters
    ----------
    root : (m, m) R with RᵀR = W
    scale : (k,) unit of each parameter; W_θ = diag(1/scale²)
    regularisation : μ
    """

    root: Reals
    scale: Reals
    regularisation: float = 0.0

    def matrix(self, G: Reals) -> Reals:
        """T (k, m); the minimum-norm one, in units of `scale`, where the outputs do not determine the parameters."""
        return np.asarray(self.scale[:, None] * self._inverse(G)[:, : len(self.root)] @ self.root)

    def rank(self, G: Reals) -> int:
        """Number of combinations of parameters that the outputs determine to first order."""
        s = np.linalg.svd(self.root @ (G * self.scale), compute_uv=False)
        return int((s > _RANK * s.max(initial=0.0)).sum())

    def _inverse(self, G: Reals) -> Reals:
        rows = self.root @ (G * self.scale)
        if self.regularisation:
            rows = np.vstack([rows, self.regularisation * np.eye(len(self.scale))])
        return np.asarray(np.linalg.pinv(rows, rcond=_RANK), dtype=float)


def estimator(
    measured: OutputStatistics, scale: Reals, weighting: OutputWeighting = "relative", regularisation: float = 0.0
) -> LinearEstimator:
    """An estimator for measured outputs.

    Parameters
    ----------
    weighting : "relative": W = diag(1/z²); "covariance": W is the inverse of the measured covariance
    regularisation : μ ≥ 0 of the chapter's equation (22), with the parameters in units of `scale`

    Raises
    ------
    FemtuneError : ``quantify.singular`` where a singular covariance is to be inverted; ``quantify.zero-mean`` where a
        mean is zero and outputs are to be weighted relative to it
    """
    if weighting == "covariance":
        return LinearEstimator(_inverse_root(measured), scale, regularisation)
    if (measured.sizes == 0.0).any():
        raise FemtuneError("quantify.zero-mean", output=measured.labels[int(np.argmin(measured.sizes))])
    return LinearEstimator(np.diag(1.0 / measured.sizes), scale, regularisation)


def _inverse_root(measured: OutputStatistics) -> Reals:
    if measured.singular:
        raise FemtuneError(
            "quantify.singular/no-inverse", values={"repeats": len(measured.repeats), "outputs": len(measured.mean)}
        )
    return np.asarray(np.linalg.inv(factor(measured.covariance)), dtype=float)


# ----------------------------------------------------------------------------------------------------
# Means of the parameters from means of the outputs: chapter equation (35), a step that goes wrong shortened.


_SHORTEST_MEAN_STEP = 1e-3
"""Fraction of a step of the means below which it is given up: ten halvings."""


@dataclass(frozen=True)
class MeanStep:
    """One point of the iteration: means (k,), outputs there (m,), weighted error and model solutions so far."""

    theta: Reals
    outputs: Reals
    error: float
    solutions: int


@dataclass(frozen=True)
class Means:
    """Result for the means: θ (k,), z(θ) (m,), G (m, k), T (k, m) of the last step, all steps."""

    theta: Reals
    outputs: Reals
    G: Reals
    T: Reals
    steps: tuple[MeanStep, ...]
    status: StochasticStatus


def update_means(
    outputs: Counted,
    target: Reals,
    start: Reals,
    by: LinearEstimator,
    max_iterations: int = 50,
    tolerance: float = 1e-6,
) -> Means:
    """θ with z(θ) as near to the target as the estimator brings it: θ ← θ + T(z_m − z(θ)).

    Ends where a step is below `tolerance` in units of the estimator's scale, or where the outputs are within
    `tolerance` of the target in its weights.

    Parameters
    ----------
    target : (m,) mean outputs
    start : (k,)

    Raises
    ------
    FemtuneError : what the model raises at the start
    """
    z, G = outputs.linearised(start)
    theta, steps = start, [MeanStep(start, z, _error(by, target - z), outputs.solutions)]
    status = StochasticStatus.MEANS_LIMIT
    while len(steps) <= max_iterations:
        d = by.matrix(G) @ (target - z)
        if _small(d, by, steps[-1].error, tolerance):
            status = _converged(by, G)
            break
        taken = _shortened(outputs, by, target, theta, d, steps[-1].error)
        if taken is None:
            status = StochasticStatus.MEANS_STALLED
            break
        theta = taken
        z, G = outputs.linearised(theta)
        steps.append(MeanStep(theta, z, _error(by, target - z), outputs.solutions))
    return Means(theta, z, G, by.matrix(G), tuple(steps), status)


def _small(d: Reals, by: LinearEstimator, error: float, tolerance: float) -> bool:
    return error <= tolerance or float(np.abs(d / by.scale).max(initial=0.0)) <= tolerance


def _converged(by: LinearEstimator, G: Reals) -> StochasticStatus:
    full = bool(by.regularisation) or by.rank(G) == G.shape[1]
    return StochasticStatus.CONVERGED if full else StochasticStatus.UNDETERMINED


def _error(by: LinearEstimator, residual: Reals) -> float:
    return float(np.sqrt(np.mean((by.root @ residual) ** 2)))


def _shortened(
    outputs: Counted, by: LinearEstimator, target: Reals, theta: Reals, d: Reals, error: float
) -> Reals | None:
    """The longest of d, d/2, d/4 … that reduces the error; None if none does."""
    length = 1.0
    while length > _SHORTEST_MEAN_STEP:
        try:
            z = outputs.linearised(theta + length * d)[0]
        except FemtuneError:
            # a full step from far away may reach values without meaning
            length *= 0.5
            continue
        if _error(by, target - z) < error:
            return theta + length * d
        length *= 0.5
    return None


# ----------------------------------------------------------------------------------------------------
# Means and covariances to second order at the price of (39): k further model solutions.
#
# Equation (39) takes z(θ) as linear over the cloud, so that its means are those of a model without curvature: off by
# ½ T H:Cov θ, per cent at a standard deviation of 20 %. With H from k differences of the sensitivity matrix the
# quadratic model
#
#     z(θ) = z₀ + G d + ½ H[d, d],  d = θ − θ₀
#
# stands for the structure, and no further solution is needed. If the repeats are available each of them is inverted
# through it, and mean and covariance are those of the inverted repeats: exact to the quadratic model for any
# distribution. Where only moments are known, or repeats have gaps, the moments of a normal distribution are matched:
# mean z₀ + G d + ½ H:C and covariance G C Gᵀ + ½ tr(H_i C H_j C).


_DIFFERENCE_STEP = 1e-3
"""Step of the differences of slopes, in standard deviations of the start: their error is of first order in it, and
rounding of the slopes is far smaller."""
_QUADRATIC_TOLERANCE = 1e-10
"""Change of parameters, in their units, that ends iterations on the quadratic model, which cost nothing."""
_QUADRATIC_ITERATIONS = 60
"""Of these iterations at most; they converge linearly where they do."""


@dataclass(frozen=True)
class QuadraticModel:
    """Outputs around θ₀ to second order: z₀ (m,), G (m, k), H (m, k, k)."""

    theta: Reals
    z: Reals
    G: Reals
    H: Reals

    def values(self, theta: Reals) -> Reals:
        """z (m,) at θ (k,)."""
        d = theta - self.theta
        return np.asarray(self.z + self.G @ d + 0.5 * (self.H @ d) @ d)

    def slope(self, theta: Reals) -> Reals:
        """∂z/∂θ (m, k)."""
        return np.asarray(self.G + self.H @ (theta - self.theta))

    def mean(self, theta: Reals, C: Reals) -> Reals:
        """Mean outputs (m,) of a distribution of mean θ and covariance C."""
        return np.asarray(self.values(theta) + 0.5 * np.einsum("ijk,jk->i", self.H, C))

    def covariance(self, theta: Reals, C: Reals) -> Reals:
        """Covariance (m, m) of the outputs of a normal distribution."""
        slope, HC = self.slope(theta), self.H @ C
        return np.asarray(slope @ C @ slope.T + 0.5 * np.einsum("iab,jba->ij", HC, HC))


def quadratic_model(outputs: Counted, at: Means, scale: Reals) -> QuadraticModel:
    """The quadratic model at the final means, by k model solutions at steps of a thousandth of `scale`."""
    return QuadraticModel(at.theta, *second_derivatives(outputs, at.theta, _DIFFERENCE_STEP * scale))


def corrected(model: QuadraticModel, measured: OutputStatistics, by: LinearEstimator) -> tuple[Reals, Reals] | None:
    """Mean (k,) and covariance (k, k) of the parameters; None if the curvature is too large."""
    if measured.complete:
        return _of_repeats(model, measured.repeats, by)
    return _of_moments(model, measured, by)


def _of_repeats(model: QuadraticModel, repeats: Reals, by: LinearEstimator) -> tuple[Reals, Reals] | None:
    parameters = [_inverse(model, z, by) for z in repeats]
    cloud = np.array([theta for theta in parameters if theta is not None])
    if len(cloud) < len(repeats):
        return None
    return cloud.mean(axis=0), np.atleast_2d(np.cov(cloud.T))


def _inverse(model: QuadraticModel, z: Reals, by: LinearEstimator) -> Reals | None:
    """θ whose quadratic outputs are z, by Newton's method from θ₀; None if it does not end."""
    theta = model.theta
    for _ in range(_QUADRATIC_ITERATIONS):
        d = by.matrix(model.slope(theta)) @ (z - model.values(theta)) - _pull(model, theta, by)
        theta = theta + d
        if np.abs(d / by.scale).max(initial=0.0) <= _QUADRATIC_TOLERANCE:
            return theta
    return None


def _pull(model: QuadraticModel, theta: Reals, by: LinearEstimator) -> Reals:
    """Pull of the regularisation on a repeat: μ²W_θ holds it near the mean, not near its last iterate."""
    if not by.regularisation:
        return np.zeros_like(theta)
    A = by.root @ model.slope(theta) * by.scale
    normal = A.T @ A + by.regularisation**2 * np.eye(len(theta))
    return np.asarray(by.scale * np.linalg.solve(normal, by.regularisation**2 * (theta - model.theta) / by.scale))


def _of_moments(model: QuadraticModel, measured: OutputStatistics, by: LinearEstimator) -> tuple[Reals, Reals] | None:
    T = by.matrix(model.G)
    theta, C = model.theta, T @ measured.structural @ T.T
    for _ in range(_QUADRATIC_ITERATIONS):
        T = by.matrix(model.slope(theta))
        curved = model.covariance(theta, C) - model.slope(theta) @ C @ model.slope(theta).T
        new = T @ (measured.structural - curved) @ T.T
        d = T @ (measured.mean - model.mean(theta, C)) - _pull(model, theta, by)
        moved = max(np.abs(d / by.scale).max(), np.abs((new - C) / np.outer(by.scale, by.scale)).max())
        theta, C = theta + d, new
        if moved <= _QUADRATIC_TOLERANCE:
            return theta, C
    return None


# ----------------------------------------------------------------------------------------------------
# Latin hypercube samples of a normal distribution with imposed correlation.
#
# Every parameter's range is cut into as many strata of equal probability as there are samples, and each stratum is
# met once (McKay, Beckman and Conover 1979). The correlation is imposed by re-ordering the ranks (Iman and Conover
# 1982), which leaves every parameter's strata as they are, or by a linear map of the normal scores after which mean
# and covariance of the sample are those requested, exactly.


Imposed = Literal["ranks", "moments"]


def latin_hypercube(mean: Reals, covariance: Reals, count: int, seed: int = 0, imposed: Imposed = "moments") -> Reals:
    """(count, k) samples of a normal distribution.

    Parameters
    ----------
    mean, covariance : (k,) and (k, k)
    count : number of samples, more than k
    seed : of the permutations and of the places within the strata
    imposed : "moments": sample mean and covariance are exactly those requested; "ranks": strata are kept exactly and
        the correlation is met as nearly as ranks can

    Raises
    ------
    FemtuneError : ``quantify.not-positive``, ``quantify.too-few-samples``
    """
    check_positive(covariance, "the covariance of the parameters")
    if count <= len(mean) + 1:
        raise FemtuneError("quantify.too-few-samples", values={"samples": count, "parameters": len(mean)})
    scores = _scores(count, len(mean), np.random.default_rng(seed))
    if imposed == "moments":
        return np.asarray(mean + _white(scores) @ factor(covariance).T)
    sd = np.sqrt(np.diag(covariance))
    return np.asarray(mean + sd * _ranked(scores, factor(correlation_of(covariance))))


def _scores(n: int, k: int, rng: np.random.Generator) -> Reals:
    """Normal scores (n, k), one in each stratum of probability 1/n, in random order."""
    strata = np.column_stack([rng.permutation(n) for _ in range(k)])
    return np.asarray(ndtri((strata + rng.uniform(size=(n, k))) / n))


def _white(scores: Reals) -> Reals:
    """Scores of zero mean and unit covariance, by the linear map that changes them least."""
    centred = scores - scores.mean(axis=0)
    values, vectors = np.linalg.eigh(np.atleast_2d(np.cov(centred.T)))
    return np.asarray(centred @ (vectors / np.sqrt(values)) @ vectors.T)


def _ranked(scores: Reals, L: Reals) -> Reals:
    """Each column's own scores in the order of correlated ones (Iman and Conover 1982)."""
    wanted = _white(scores) @ L.T
    ranks = wanted.argsort(axis=0).argsort(axis=0)
    return np.take_along_axis(np.sort(scores, axis=0), ranks, axis=0)


# ----------------------------------------------------------------------------------------------------
# Means and covariances by propagating a cloud through the model: chapter equations (40) and (41).


CovarianceStep = Callable[[Reals, Reals, Reals, Reals], Reals]
"""T (k, m), parameters (n, k) and outputs (n, m) of a cloud, measured covariance (m, m) -> covariance (k, k) of the
parameters of the next cloud."""

_SHORTEST_CLOUD_STEP = 1e-2
"""Fraction of the step to a new covariance below which no positive definite one is found on the way: seven halvings."""
_LEAST_CORRELATION_EIGENVALUE = 1e-3
"""Smallest eigenvalue of the correlations of a cloud: samples of a nearly singular one show nothing of its narrow
direction."""
_TRIES = 8
"""Clouds drawn halfway back after one that the model cannot follow: down to 0.4 % of the way."""


@dataclass(frozen=True)
class CloudRules:
    """How the cloud is drawn and when it has converged.

    Parameters
    ----------
    samples : model solutions of one cloud
    seed : of the Latin hypercube; every iteration draws with the same one, so that the iteration has a limit
    max_iterations : clouds at most
    tolerance : largest change of means and standard deviations, in units of the standard deviations of the start, at
        convergence
    """

    samples: int = 1000
    seed: int = 0
    max_iterations: int = 30
    tolerance: float = 1e-4


@dataclass(frozen=True)
class CloudStep:
    """One iteration of the samples: mean (k,) and covariance (k, k) of the parameters, mean outputs (m,) and solutions
    so far."""

    mean: Reals
    covariance: Reals
    outputs: Reals
    solutions: int


@dataclass(frozen=True)
class CloudResult:
    """Final samples, and T (k, m) of the last step."""

    steps: tuple[CloudStep, ...]
    T: Reals
    status: StochasticStatus


def propagate(outputs: Counted, theta: Reals) -> Reals:
    """Outputs (n, m) of samples (n, k).

    Raises
    ------
    FemtuneError : ``quantify.not-finite``, and what the model raises
    """
    return np.array([outputs.values(row) for row in theta])


def update_cloud(
    outputs: Counted,
    measured: OutputStatistics,
    mean: Reals,
    C: Reals,
    by: LinearEstimator,
    next_covariance: CovarianceStep,
    rules: CloudRules = CloudRules(),
) -> CloudResult:
    """Move a cloud of parameters until its outputs have the measured mean and covariance.

    Means by (35) with the mean of the propagated outputs, covariance by `next_covariance`.

    Parameters
    ----------
    mean, C : (k,), (k, k) of the first cloud

    Raises
    ------
    FemtuneError : ``quantify.not-positive``, ``quantify.too-few-samples``, ``quantify.not-finite``
    """  # fmt: skip
    steps: list[CloudStep] = []
    status, scale = StochasticStatus.CLOUD_LIMIT, by.scale
    T = np.zeros((len(mean), len(measured.mean)))
    while len(steps) < rules.max_iterations:
        mean, C, theta, z = _drawn(outputs, mean, C, steps, rules)
        T = by.matrix(outputs.linearised(mean)[1])
        steps.append(CloudStep(mean, C, z.mean(axis=0), outputs.solutions))
        moved = T @ (measured.mean - z.mean(axis=0))
        new = next_covariance(T, theta, z, measured.structural)
        if _small_change(moved / scale, new, C, scale, rules.tolerance):
            status = StochasticStatus.CONVERGED
            break
        toward = _positive(C, new)
        if toward is None:
            status = StochasticStatus.NOT_POSITIVE
            break
        mean, C = mean + moved, toward
    return CloudResult(tuple(steps), T, status)


def _drawn(
    outputs: Counted, mean: Reals, C: Reals, before: list[CloudStep], rules: CloudRules
) -> tuple[Reals, Reals, Reals, Reals]:
    """A cloud and its outputs, drawn back towards the one before where it reaches values without meaning."""
    for _ in range(_TRIES):
        theta = latin_hypercube(mean, C, rules.samples, rules.seed)
        try:
            return mean, C, theta, propagate(outputs, theta)
        except FemtuneError:
            if not before:
                raise
            mean, C = 0.5 * (mean + before[-1].mean), 0.5 * (C + before[-1].covariance)
    return mean, C, theta, propagate(outputs, theta)


def output_difference(T: Reals, theta: Reals, z: Reals, measured: Reals) -> Reals:
    """Equation (41), Govers and Link (2010); see `CovarianceStep`."""
    C, _, spread = _covariances(theta, z)
    return np.asarray(C + T @ (measured - spread) @ T.T)


def cross_covariance(T: Reals, theta: Reals, z: Reals, measured: Reals) -> Reals:
    """Equation (40), Khodaparast, Mottershead and Friswell (2008); see `CovarianceStep`."""
    C, cross, spread = _covariances(theta, z)
    return np.asarray(C - cross @ T.T + T @ (spread + measured) @ T.T - T @ cross.T)


def _covariances(theta: Reals, z: Reals) -> tuple[Reals, Reals, Reals]:
    """Sample covariances (k, k) of the parameters, (k, m) of parameters and outputs, (m, m) of the outputs."""
    k = theta.shape[1]
    joint = np.cov(np.hstack([theta, z]).T)
    return joint[:k, :k], joint[:k, k:], joint[k:, k:]


def _positive(old: Reals, new: Reals) -> Reals | None:
    """The new covariance, or the point nearest to it on the way there that is positive definite; None if none is."""
    length = 1.0
    while length > _SHORTEST_CLOUD_STEP:
        C = old + length * (new - old)
        if least_eigenvalue(C) > _LEAST_CORRELATION_EIGENVALUE:
            return np.asarray(C)
        length *= 0.5
    return None


def _small_change(moved: Reals, new: Reals, old: Reals, scale: Reals, tolerance: float) -> bool:
    sd = [np.sqrt(np.maximum(np.diag(c), 0.0)) / scale for c in (new, old)]
    change = np.abs((new - old) / np.outer(scale, scale)).max()
    return max(np.abs(moved).max(), np.abs(sd[0] - sd[1]).max(), change) <= tolerance


@dataclass(frozen=True)
class StochasticRules:
    """Settings of a stochastic update.

    Parameters
    ----------
    method : of the covariance. "perturbation" is chapter equation (39), "cross-covariance" (40), "output-difference"
        (41), "second-order" is (39) with the curvature of the outputs taken into account
    weighting, regularisation : of the estimator, see `estimator`
    max_iterations, tolerance : of the means, see `update_means`
    cloud : of (40) and (41)
    """

    method: QuantifyMethod = "second-order"
    weighting: OutputWeighting = "relative"
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
        return ("mottershead2011", "silva2016", *QUANTIFY_METHODS[self.rules.method].citations)


def stochastic_update(
    outputs: Outputs,
    measured: OutputStatistics,
    names: Sequence[str],
    start: Reals,
    start_sd: Reals,
    rules: StochasticRules = StochasticRules(),
) -> StochasticResult:
    """Mean and covariance of k parameters for which the outputs have the measured mean and covariance.

    Parameters
    ----------
    outputs : model, in the units of `measured`
    measured : m outputs
    start, start_sd : (k,) first means and standard deviations; the standard deviations are the units in which steps
        are measured, used by a regularisation, and of the first samples

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
    method: Callable[..., Moments] = QUANTIFY_METHODS[rules.method].load()
    moments = method(counted, measured, by, start, start_sd, rules)
    G = counted.linearised(moments.mean)[1] if moments.G is None else moments.G
    covariance = moments.covariance if measured.noise is None else _definite(moments.covariance, start_sd)
    return StochasticResult(
        names=tuple(names),
        mean=moments.mean,
        covariance=covariance,
        start=start,
        start_sd=start_sd,
        measured=measured,
        T=moments.T,
        G=G,
        steps=moments.steps,
        solutions=moments.solutions,
        status=moments.status,
        rules=rules,
        unexplained=unexplained(G, measured),
    )


def _definite(covariance: Reals, scale: Reals) -> Reals:
    """The nearest covariance without negative variances, in units of `scale` (k,)."""
    unit = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(covariance / unit)
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * unit)


@dataclass(frozen=True)
class Moments:
    """What a method of [quantify] estimates: fields as of `StochasticResult`; G is None if it was not computed."""

    mean: Reals
    covariance: Reals
    T: Reals
    G: Reals | None
    steps: tuple[MeanStep | CloudStep, ...]
    status: StochasticStatus
    solutions: int


def by_perturbation(
    counted: Counted, measured: OutputStatistics, by: LinearEstimator, start: Reals, sd: Reals, rules: StochasticRules
) -> Moments:
    """Means by iteration, covariance by equation (39)."""
    at = update_means(counted, measured.mean, start, by, rules.max_iterations, rules.tolerance)
    covariance = at.T @ measured.structural @ at.T.T
    return Moments(at.theta, covariance, at.T, at.G, at.steps, at.status, counted.solutions)


def by_second_order(
    counted: Counted, measured: OutputStatistics, by: LinearEstimator, start: Reals, sd: Reals, rules: StochasticRules
) -> Moments:
    """As `by_perturbation`, corrected for the curvature of the outputs."""
    at = update_means(counted, measured.mean, start, by, rules.max_iterations, rules.tolerance)
    moments, status = (at.theta, at.T @ measured.structural @ at.T.T), at.status
    if status.ok:
        better = corrected(quadratic_model(counted, at, by.scale), measured, by)
        moments, status = (moments, StochasticStatus.TOO_CURVED) if better is None else (better, status)
    return Moments(*moments, at.T, at.G, at.steps, status, counted.solutions)


def by_cross_covariance(
    counted: Counted, measured: OutputStatistics, by: LinearEstimator, start: Reals, sd: Reals, rules: StochasticRules
) -> Moments:
    """Mean and covariance of samples, by equation (40)."""
    return _by_cloud(counted, measured, by, start, sd, rules, cross_covariance)


def by_output_difference(
    counted: Counted, measured: OutputStatistics, by: LinearEstimator, start: Reals, sd: Reals, rules: StochasticRules
) -> Moments:
    """Mean and covariance of samples, by equation (41)."""
    return _by_cloud(counted, measured, by, start, sd, rules, output_difference)


def _by_cloud(
    counted: Counted,
    measured: OutputStatistics,
    by: LinearEstimator,
    start: Reals,
    sd: Reals,
    rules: StochasticRules,
    next_covariance: CovarianceStep,
) -> Moments:
    cloud = update_cloud(counted, measured, start, np.diag(sd**2), by, next_covariance, rules.cloud)
    last = cloud.steps[-1]
    return Moments(last.mean, last.covariance, cloud.T, None, cloud.steps, cloud.status, counted.solutions)


def unexplained(G: Reals, measured: OutputStatistics) -> float:
    """Share of the outputs' variance outside the range of G, to first order; zero for a square G of full rank.

    A wrong set of parameters can still reproduce the mean; the covariance shows it. Outputs are scaled by
    their means, as their weights are, and variances are summed over all of them.
    """
    scale = np.where(measured.sizes != 0.0, measured.sizes, 1.0)
    u, s, _ = np.linalg.svd(G / scale[:, None], full_matrices=False)
    u = u[:, s > 1e-8 * s.max(initial=0.0)]
    C = measured.structural / np.outer(scale, scale)
    total = float(np.trace(C))
    return min(1.0, max(0.0, 1.0 - float(np.trace(u.T @ C @ u)) / total)) if total > 0.0 else 0.0


def _check_start(names: tuple[str, ...], start: Reals, sd: Reals) -> None:
    if not len(names) == len(start) == len(sd):
        raise FemtuneError(
            "quantify.size/parameters",
            values={"names": len(names), "means": len(start), "standard deviations": len(sd)},
        )
    if not (np.isfinite(sd) & (sd > 0.0)).all():
        i = int(np.argmin(np.where(np.isfinite(sd), sd, -np.inf)))
        raise FemtuneError("quantify.start-sd", values={"standard deviation": sd[i]}, parameter=names[i])
    check_positive(np.diag(sd**2), "the covariance of the parameters at the start")


def _check_outputs(counted: Counted, measured: OutputStatistics, start: Reals) -> None:
    size = len(counted.linearised(start)[0])
    if size != len(measured.mean):
        raise FemtuneError("quantify.size/outputs", values={"predicted": size, "measured": len(measured.mean)})
