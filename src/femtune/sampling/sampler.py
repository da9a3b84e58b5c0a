"""Samples of the posterior distribution of the parameters, weighted by the model itself.

Samples are drawn where the model is cheap: from its linearised residuals at the result of the update; where these do
not hold, from a polynomial surrogate of the residuals. It is fitted to solutions with derivatives, and refined where
its own samples are. The model is then solved at every sample, and each gets the weight of the true density over the one
that it was drawn from. The weights tell whether that was enough: by their effective number, and by the shape k̂ of their
tail. Nothing is reported that they do not support.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeAlias

import numpy as np
import scipy.linalg as la
from scipy.optimize import minimize

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.sampling.chains import ChainRules, ChainSamples, run_chains
from femtune.sampling.coordinates import NormalBox, log_normal
from femtune.sampling.kinds import Route, Sampling
from femtune.sampling.likelihood import Likelihood
from femtune.sampling.surrogate import (
    Known,
    Monomials,
    PolynomialResiduals,
    ReducedSurrogate,
    Scaled,
    fit_surrogate,
    linear_surrogate,
)
from femtune.sampling.tmcmc import transitional
from femtune.sampling.weights import SmoothedWeights, log_integral, smoothed_weights

LARGEST_K = 0.7
"""Shape of the tail of the weights up to which averages converge at a usual rate (Vehtari and others)."""
FEWEST_EFFECTIVE = 100.0
"""Effective samples below which a standard deviation is known to worse than 7 %. k̂ alone does not tell: weights with
27 effective samples of 1,500 have been seen with k̂ = 0.7."""
_ALMOST_EQUAL = 0.9
"""Effective part of the samples from which their weights are almost equal: k̂ is then the shape of differences that do
not matter."""
GOOD_ERROR = 1.0
"""Standard deviation of log p − log p̂ over the samples at which more than a third of them is effective. Above it the
samples may miss a part of the distribution although k̂ is small and hundreds of them are effective: of 40 curved
valleys 17 were sampled from linearised residuals with a deviation of 4 and more, and ends of their 95 % intervals were
wrong by 0.1 to 1.8 standard deviations."""
_PILOTS = 60
"""Samples of the linear distribution that are solved first."""
_PILOT_ERROR = 1.3
"""Standard deviation of their log weights over `GOOD_ERROR` up to which the linear distribution is sampled as asked: of
60 samples it is known to a tenth."""
_PER_COEFFICIENT = 1.6
"""Equations for each coefficient of a surrogate in the first round."""
_ROUND = 30
"""Solutions with derivatives in each further round."""
_PLAIN_ROUND = 150
"""Solutions without derivatives in a last round."""
_MOST_COEFFICIENTS = 520
"""Coefficients of a surrogate: a cubic one of 12 parameters, a quadratic one of 30."""
_EVIDENCE_SAMPLES = 4_000
"""Samples, drawn at random, from which the evidence is computed; its standard deviation is stated."""
_FEWEST_OF_CHAINS = 10.0
"""Effective samples of transitional chains below which nothing is reported: a standard deviation is then known to a
fourth. Those who ask for this method get what it gives, with its effective number."""
_SIZES = (float(np.log(0.01)), float(np.log(100.0)))
"""Logarithms of the sizes of the errors of the data over the stated ones, between which transitional chains look."""
_SOFT = 6.0
"""Distance past the limits of the logarithm of a size at which its prior is nothing: e⁻¹²."""
_INNER = 2.5
"""Place in standard normal coordinates where chains begin that would begin on a bound."""


_MOST_STEPS = 500
"""Of the search for the highest density."""
_BEGINNINGS = (0.3, 0.6, 0.9)
"""Sizes of the changes of the model from which it begins, between their limits in the logarithm."""
_NOWHERE = 1e30
"""Negative log density of a point that the search must not take."""
_FAR = 6.0
"""Place in standard normal coordinates that is as good as a bound."""

_Density: TypeAlias = Callable[[Reals], tuple[Reals, Reals]]


class ModelAtSamples(Protocol):
    """The residuals of the model, those of a prior among them, at several points."""

    def __call__(self, points: Sequence[Reals], derivatives: bool) -> list[Known | None]:
        """One for each point; None where the model could not be solved."""
        ...


@dataclass(frozen=True)
class SamplingRules:
    """Effort.

    Parameters
    ----------
    draws : weighted samples
    seed : of all random numbers
    gradients : solutions with derivatives at most, for a surrogate
    sampling : "automatic", or "tmcmc" with `draws` samples in each stage
    """

    draws: int = 1000
    seed: int = 0
    gradients: int = 150
    chain: ChainRules = field(default_factory=ChainRules)
    sampling: Sampling = "automatic"


@dataclass(frozen=True, eq=False)
class PosteriorSamples:
    """Weighted samples.

    Parameters
    ----------
    x, theta : (n, k) parameters, and (n, t) logarithms of the sizes of the errors
    residuals : (n, m) of the model there
    weights : of the samples
    log_evidence, log_evidence_sd : logarithm of the integral of likelihood times uniform prior between the bounds
    route, degree : what was sampled from; degree 0 without polynomials
    error : standard deviation of log p − log p̂ over the samples where the model was solved; None without p̂
    r_hat, displacement : of the chains on what was sampled from; None without such chains
    stages : of transitional chains; 0 without them
    linear : (c, k) samples of the linearised residuals with the same prior and errors
    of_data : (c, k) samples of what was sampled from, with errors of the data alone; None where no others are taken
    gradients, plain : number of solutions with and without derivatives
    failed : number of samples where the model could not be solved
    tried : what did not hold before, in sentences
    """

    x: Reals
    theta: Reals
    residuals: Reals
    weights: SmoothedWeights
    log_evidence: float
    log_evidence_sd: float
    route: Route
    degree: int
    error: float | None
    r_hat: float | None
    displacement: float | None
    linear: Reals
    of_data: Reals | None
    gradients: int
    plain: int
    failed: int
    tried: tuple[str, ...]
    stages: int = 0


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Samples of a surrogate."""

    surrogate: PolynomialResiduals
    reduced: ReducedSurrogate
    chain: ChainSamples
    density: _Density


@dataclass(eq=False)
class Sampler:
    """A posterior to be sampled.

    Parameters
    ----------
    start : the model at the result of the update, with its Jacobian
    scaled : coordinates of surrogates, not yet scaled
    model : solves
    alone : the model as it is, from which samples with errors of the data alone are taken; None where `model` is that
        model
    tell : is told what is done, in words
    """

    likelihood: Likelihood
    box: NormalBox
    start: Known
    scaled: Scaled
    model: ModelAtSamples
    rules: SamplingRules
    tell: Callable[[str], None] = lambda text: None
    alone: Known | None = None
    known: list[tuple[Known, Reals]] = field(default_factory=list)
    gradients: int = 0
    plain: int = 0
    failed: int = 0
    tried: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.rules.seed)
        self.k = len(self.start.x)

    def run(self) -> PosteriorSamples:
        """The samples.

        Raises
        ------
        FemtuneError : ``posterior.not-sampled`` with the reason
        """
        assert self.start.jacobian is not None
        self.tell("chains on the linearised residuals")
        linear = self._drawn(linear_surrogate(self.start.x, self.start.residuals, self.start.jacobian), self._first())
        if self.rules.sampling == "tmcmc":
            return self._transitional(linear)
        pilot = self._solved(linear, min(_PILOTS, self.rules.draws), False)
        sample = None
        if self._error(linear, pilot) <= _PILOT_ERROR * GOOD_ERROR:
            sample = self._weighted(linear, linear, "linear", pilot)
            if sample is not None and (sample.error or 0.0) <= GOOD_ERROR:
                return sample
        self.tried.append(self._words("the linearised residuals", linear, pilot if sample is None else self.known))
        try:
            return self._by_surrogate(linear)
        except FemtuneError as error:
            # what can be had without a surrogate, with the deviation that tells how rough it is
            if error.code == "posterior.not-sampled" and sample is None:
                sample = self._weighted(linear, linear, "linear", pilot)
            if error.code != "posterior.not-sampled" or sample is None:
                raise
            return replace(sample, tried=tuple(self.tried), gradients=self.gradients, plain=self.plain)

    def _transitional(self, linear: _Drawn) -> PosteriorSamples:
        k, estimated = self.k, len(self.likelihood.estimated)
        lower, upper = _SIZES
        theta = np.column_stack([
            *(self.rng.uniform(lower, upper, self.rules.draws) for _ in range(estimated)),
            *(self._prior_sizes(j) for j in range(estimated, self.likelihood.size)),
        ]) if self.likelihood.size else np.zeros((self.rules.draws, 0))  # fmt: skip

        def log_prior(z: Reals) -> Reals:
            sizes = z[:, k : k + estimated]
            inside = ((sizes >= lower) & (sizes <= upper)).all(axis=1)
            return np.asarray(np.where(inside, log_normal(z[:, :k]) + self.likelihood.prior(z[:, k:])[0], -np.inf))

        def log_likelihood(z: Reals) -> Reals:
            log = np.full(len(z), -np.inf)
            found = self.model(list(self.box.inside(z[:, :k])), False)
            rows = np.array([i for i, one in enumerate(found) if one is not None], dtype=int)
            self.plain, self.failed = self.plain + len(z), self.failed + len(z) - len(rows)
            if len(rows):
                log[rows] = self.likelihood.at(
                    np.array([one.residuals for one in found if one is not None]), z[rows, k:]
                )
            return log

        start = np.column_stack([self.rng.standard_normal((self.rules.draws, k)), theta])
        end = transitional(log_likelihood, log_prior, start, self.rng, lambda text: self.tell(f"TMCMC, {text}"))
        if not end.ended or end.effective < _FEWEST_OF_CHAINS:
            raise self._not_sampled(
                f"after {end.stages} stages of TMCMC with {self.rules.draws} samples {end.effective:.0f} are "
                f"independent of each other, and {_FEWEST_OF_CHAINS:.0f} are needed; about "
                f"{_FEWEST_OF_CHAINS * self.rules.draws / max(end.effective, 1.0):.1g} draws would do, or the default "
                "of sampling, which takes fewer solutions"
            )
        x = self.box.inside(end.z[:, :k])
        n = len(x)
        # solved before: of all that was solved these alone are kept
        residuals = np.array([one.residuals for one in self.model(list(x), False) if one is not None])
        weights = SmoothedWeights(np.full(n, 1.0 / n), 0.0, end.effective, 0.0, end.log_evidence_sd)
        return PosteriorSamples(
            x=x, theta=end.z[:, k:], residuals=residuals,
            weights=weights, log_evidence=end.log_evidence + estimated * float(np.log(upper - lower)),
            log_evidence_sd=end.log_evidence_sd, route="tmcmc", degree=0, error=None, r_hat=None, displacement=None,
            linear=self.box.inside(linear.chain.flat[:, :k]), of_data=None, gradients=0, plain=self.plain,
            failed=self.failed, tried=(), stages=end.stages,
        )  # fmt: skip

    def _prior_sizes(self, j: int) -> Reals:
        """(n,) samples of the prior of one size of errors of the model, by rejection."""
        lower, upper = np.log(self.likelihood.classes[j - len(self.likelihood.estimated)].limits)
        theta, out = np.zeros((4 * self.rules.draws, self.likelihood.size)), np.zeros(0)
        highest = self.likelihood.prior(self._with(theta[:1], j, 0.5 * (lower + upper)))[0][0]
        while len(out) < self.rules.draws:
            tried = self.rng.uniform(lower - _SOFT, upper + _SOFT, len(theta))
            log = self.likelihood.prior(self._with(theta, j, tried))[0] - highest
            out = np.concatenate([out, tried[np.log(self.rng.random(len(theta))) < log]])
        return out[: self.rules.draws]

    @staticmethod
    def _with(theta: Reals, j: int, values: Reals | float) -> Reals:
        theta[:, j] = values
        return theta

    def _by_surrogate(self, linear: _Drawn) -> PosteriorSamples:
        degree = self._degree()
        drawn = linear
        count = int(np.ceil(_PER_COEFFICIENT * Monomials.number(self.k, degree) / (self.k + 1)))
        count = min(max(count, _ROUND), self.rules.gradients)
        while self.gradients < self.rules.gradients:
            points = self._solved(drawn, min(count, self.rules.gradients - self.gradients), True)
            if drawn is not linear and self._error(drawn, points) < GOOD_ERROR:
                break
            drawn = self._refined(drawn, degree)
            count = _ROUND
        self._solved(drawn, _PLAIN_ROUND, False)
        drawn = self._refined(drawn, degree, final=True)
        for _ in range(2):
            sample = self._weighted(drawn, linear, "surrogate")
            if sample is not None:
                return sample
            drawn = self._refined(drawn, degree, final=True)
        raise self._not_sampled("; ".join(self.tried))

    def _degree(self) -> int:
        """The highest degree that the solutions can determine."""
        equations = self.rules.gradients * (self.k + 1)
        for degree in (3, 2):
            q = Monomials.number(self.k, degree)
            if q <= _MOST_COEFFICIENTS and _PER_COEFFICIENT * q <= equations:
                return degree
        q = Monomials.number(self.k, 2)
        raise self._not_sampled(
            f"{'; '.join(self.tried)}; a quadratic surrogate of {self.k} parameters has {q} coefficients, more than "
            f"{self.rules.gradients} solutions with derivatives determine"
        )

    def _not_sampled(self, reason: str) -> FemtuneError:
        return FemtuneError(
            "posterior.not-sampled", reason=reason,
            values={"solutions with derivatives": self.gradients, "other solutions": self.plain},
        )  # fmt: skip

    def _first(self) -> Reals:
        """(c, d) points about the result, by the curvature there."""
        likelihood, chains = self.likelihood, self.rules.chain.chains
        v = np.clip(self.box.normal(self.start.x[None]), -_INNER, _INNER)
        theta = np.concatenate([
            [0.5 * np.log(max(float(np.mean(self.start.residuals[likelihood.groups[i].rows] ** 2)), 1e-12))
             for i in likelihood.estimated],
            [0.5 * np.log(np.prod(one.limits)) for one in likelihood.classes],
        ])  # fmt: skip
        weight = 1.0 / likelihood.sizes(theta)[0]
        J = weight[:, None] * np.asarray(self.start.jacobian) * self.box.slope(v)
        root = la.cholesky(la.inv(J.T @ J + np.eye(self.k)), lower=True)
        points = v + self.rng.standard_normal((chains, self.k)) @ root.T
        return np.column_stack([points, theta + 0.2 * self.rng.standard_normal((chains, len(theta)))])

    def most_likely(self) -> tuple[Reals, Reals, float]:
        """Parameters (k,) and sizes of the errors (t,) of the highest density, with the linearised residuals; its
        logarithm."""
        assert self.start.jacobian is not None
        first, k = self._first(), self.k
        surrogate = linear_surrogate(self.start.x, self.start.residuals, self.start.jacobian)
        _, density = self._density(surrogate, first)

        def function(z: Reals) -> tuple[float, Reals]:
            log, slope = density(z[None])
            return (-float(log[0]), -slope[0]) if np.isfinite(log[0]) else (_NOWHERE, np.zeros(len(z)))

        # steps of the search may be long: neither sizes nor places leave where they mean something
        limits = np.array([np.log(c.limits) for c in self.likelihood.classes]).reshape(-1, 2)
        ends = [tuple(e) for e in limits + np.array([-1.0, 1.0])]
        bounds = [(-_FAR, _FAR)] * k + [_SIZES] * len(self.likelihood.estimated) + ends
        begin = np.clip(first[np.argmax(density(first)[0])], *np.array(bounds).T)
        found = []
        for part in _BEGINNINGS:
            # a class whose changes begin small stays small if another explains the data too
            begin[len(begin) - len(limits) :] = limits @ np.array([1.0 - part, part])
            found.append(
                minimize(function, begin, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _MOST_STEPS})
            )
        end = min(found, key=lambda one: float(one.fun))
        return self.box.inside(end.x[None, :k])[0], end.x[k:], -float(end.fun)

    def _density(self, surrogate: PolynomialResiduals, start: Reals) -> tuple[ReducedSurrogate, _Density]:
        k = self.k
        reduced = surrogate.for_chains(self.likelihood, self.box.inside(start[:, :k]), self._sigma(start[:, k:]))

        def density(z: Reals) -> tuple[Reals, Reals]:
            v, theta = z[:, :k], z[:, k:]
            log, by_x, by_theta = reduced.log_likelihood(self.box.inside(v), theta)
            prior, by_prior = self.likelihood.prior(theta)
            slope = np.column_stack([by_x * self.box.slope(v) - v, by_theta + by_prior])
            return log + log_normal(v) + prior, slope

        return reduced, density

    def _drawn(self, surrogate: PolynomialResiduals, start: Reals, final: bool = True) -> _Drawn:
        reduced, density = self._density(surrogate, start)
        rules = self.rules.chain
        if not final:
            rules = replace(rules, windows=tuple(w // 2 for w in rules.windows), most=rules.kept)
        elif surrogate.monomials.degree == 1:
            # what it misses, the weights tell
            rules = replace(rules, most=rules.most // 3)
        chains = run_chains(density, start, rules, self.rng, lambda steps: self.tell(f"chains, {steps} steps"))
        return _Drawn(surrogate, reduced, chains, density)

    def _of_data(self, drawn: _Drawn) -> Reals | None:
        """Samples with errors of the data alone."""
        if not self.likelihood.classes:
            return None
        self.tell("chains with errors of the data alone")
        alone = replace(
            self, likelihood=self.likelihood.without_classes(), known=[], tried=[], start=self.alone or self.start
        )
        if self.alone is None:
            start, surrogate = drawn.chain.values[-1][:, : self.k + len(self.likelihood.estimated)], drawn.surrogate
        else:
            assert self.alone.jacobian is not None
            start = alone._first()
            surrogate = linear_surrogate(self.alone.x, self.alone.residuals, self.alone.jacobian)
        return self.box.inside(alone._drawn(surrogate, start).chain.flat[:, : self.k])

    def _sigma(self, theta: Reals) -> Reals:
        """Mean factor of each group."""
        sigma = np.ones(len(self.likelihood.groups))
        for j, i in enumerate(self.likelihood.estimated):
            sigma[i] = np.exp(theta[:, j].mean())
        return sigma

    def _refined(self, drawn: _Drawn, degree: int, final: bool = False) -> _Drawn:
        """The surrogate of all solutions so far, and its samples."""
        points = [p for p, _ in self.known]
        x = np.array([p.x for p in points])
        theta = np.array([t for _, t in self.known])
        log = self.likelihood.at(np.array([p.residuals for p in points]), theta)
        below = log.max() - log
        weights = 1.0 / (1.0 + below / self.k)
        # the region of the better half
        inside = x[below <= np.median(below)]
        self.tell("chains on a surrogate of the residuals")
        surrogate = fit_surrogate(points, weights, self.scaled.about(inside), degree)
        return self._drawn(surrogate, drawn.chain.values[-1], final)

    def _solved(self, drawn: _Drawn, count: int, derivatives: bool) -> list[tuple[Known, Reals]]:
        """The model at some samples; it is kept for surrogates."""
        x, theta = self._choose(drawn, count)
        residuals = self.model(list(x), derivatives)
        solved = [(f, t) for f, t in zip(residuals, theta) if f is not None]
        self.gradients += count if derivatives else 0
        self.plain += 0 if derivatives else count
        self.failed += count - len(solved)
        if len(solved) < max(2, count // 2):
            raise self._not_sampled(f"the model could not be solved at {count - len(solved)} of {count} samples")
        self.known += solved
        return solved

    def _choose(self, drawn: _Drawn, count: int) -> tuple[Reals, Reals]:
        flat = drawn.chain.flat
        z = flat[self.rng.choice(len(flat), count, replace=len(flat) < count)]
        return self.box.inside(z[:, : self.k]), z[:, self.k :]

    def _log_weights(self, drawn: _Drawn, points: Sequence[tuple[Known, Reals]]) -> Reals:
        theta = np.array([t for _, t in points])
        true = self.likelihood.at(np.array([p.residuals for p, _ in points]), theta)
        return true - drawn.reduced.log_likelihood(np.array([p.x for p, _ in points]), theta)[0]

    def _error(self, drawn: _Drawn, points: Sequence[tuple[Known, Reals]]) -> float:
        return float(np.std(self._log_weights(drawn, points)))

    def _words(self, what: str, drawn: _Drawn, points: Sequence[tuple[Known, Reals]]) -> str:
        return f"{what} do not hold: the logarithms of the weights have a standard deviation of " + (
            f"{self._error(drawn, points):.2g}"
        )

    def _weighted(
        self, drawn: _Drawn, linear: _Drawn, route: Route, known: Sequence[tuple[Known, Reals]] = ()
    ) -> PosteriorSamples | None:
        """Samples with weights, `known` ones among them; None where the weights do not support them."""
        self.tell("model at the samples")
        points = [*known, *self._solved(drawn, self.rules.draws - len(known), False)]
        log = self._log_weights(drawn, points)
        n, missing = len(points), self.rules.draws - len(points)
        weights = smoothed_weights(log)
        degree = drawn.surrogate.monomials.degree
        enough = weights.effective >= min(FEWEST_EFFECTIVE, 0.5 * n)
        if not (enough and (weights.k_hat <= LARGEST_K or weights.effective >= _ALMOST_EQUAL * n)):
            what = "the linearised residuals" if route == "linear" else f"a surrogate of degree {degree}"
            k_hat = f"k̂ = {weights.k_hat:.2f}"
            self.tried.append(f"{what}: {weights.effective:.0f} of {n} samples are effective, {k_hat}")
            return None
        flat = drawn.chain.flat
        some = flat[self.rng.choice(len(flat), min(_EVIDENCE_SAMPLES, len(flat)), replace=False)]
        log_z, log_z_sd = log_integral(some, lambda z: drawn.density(z)[0], self.rng)
        theta = np.array([t for _, t in points])
        return PosteriorSamples(
            x=np.array([p.x for p, _ in points]), theta=theta, weights=weights,
            residuals=np.array([p.residuals for p, _ in points]),
            log_evidence=log_z + weights.log_mean + float(np.log(n / (n + missing))),
            log_evidence_sd=float(np.hypot(log_z_sd, weights.log_mean_sd)),
            route=route, degree=degree, error=float(np.std(log)),
            r_hat=drawn.chain.r_hat, displacement=drawn.chain.displacement,
            linear=self.box.inside(linear.chain.flat[:, : self.k]), of_data=self._of_data(drawn),
            gradients=self.gradients, plain=self.plain, failed=self.failed, tried=tuple(self.tried),
        )  # fmt: skip
