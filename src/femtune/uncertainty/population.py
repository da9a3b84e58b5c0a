"""The distribution of the parameters over nominally identical structures, with the uncertainty of all it is made of.

Structure i has parameters θ_i that are normal with mean μ and covariance Σ, and its measured outputs are z_i = z(θ_i) +
e_i with errors e_i of covariance R. All θ_i, μ and Σ are unknown: each structure tells of its own parameters, and the
others tell where they may lie. Beforehand μ is uniform, the standard deviations are half-Student with two degrees of
freedom (any size up to that of the scale is about as likely), and the correlations are uniform each.

Gibbs sampler: θ_i given μ and Σ, from the normal distribution of linearised outputs, corrected by a Metropolis step on
the quadratic ones; μ and Σ given all θ_i; and a step that moves μ with all θ_i, which a narrow population needs.

Sources: A. Huang, M. P. Wand, Simple marginally noninformative prior distributions for covariance matrices, Bayesian
Analysis 8, 2013; A. Gelman, J. B. Carlin, H. S. Stern, D. B. Dunson, A. Vehtari, D. B. Rubin, Bayesian Data Analysis,
3rd ed., CRC Press 2014, chapters 5 and 11; D. J. Spiegelhalter, N. G. Best, B. P. Carlin, A. van der Linde, Bayesian
measures of model complexity and fit, Journal of the Royal Statistical Society B 64, 2002.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.uncertainty.stochastic import QuadraticModel

_DEGREES = 2.0
"""Degrees of freedom of the half-Student distributions: correlations are then uniform (Huang and Wand)."""
_STEPS = 6
"""Steps to the place where the outputs of a structure are linearised."""
MIXED_POPULATION = 1.05
"""R-hat up to which chains have forgotten where they began."""


@dataclass(frozen=True)
class PopulationRules:
    """Chains side by side, sweeps of each, and the first part that is not used; more sweeps are made up to `most`."""

    chains: int = 4
    sweeps: int = 4000
    most: int = 32_000
    kept: int = 1000
    seed: int = 0


@dataclass(frozen=True, eq=False)
class PopulationSamples:
    """Samples (n) of a population.

    Parameters
    ----------
    mean, sd : (n, k) of the population
    correlation : (n, k, k)
    individual : (n, p, k) parameters of each structure
    new : (n, k) parameters of a further structure
    r_hat : of the slowest of means and logarithms of standard deviations
    misfit, degrees : sum of squares of the errors over their variances at the median of each structure, and its
        expected value if the outputs are right: their number less the effective number of parameters (Spiegelhalter
        and others 2002)
    accepted : part of the Metropolis steps that were accepted
    """

    mean: Reals
    sd: Reals
    correlation: Reals
    individual: Reals
    new: Reals
    r_hat: float
    misfit: float
    degrees: float
    accepted: float


def sample_population(
    rows: Reals, noise: Reals, model: QuadraticModel, scale: Reals, rules: PopulationRules = PopulationRules(),
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> PopulationSamples:  # fmt: skip
    """Samples of the population, given measured outputs of some of its structures.

    Parameters
    ----------
    rows : (p, m) measured outputs, NaN where they were not measured
    noise : (m, m) covariance R of the errors of a row
    model : outputs about the middle of the population
    scale : (k,) size of a standard deviation that would be surprisingly large, in the units of the parameters
    tell : is told the sweeps that are done, and their number

    Raises
    ------
    FemtuneError : ``quantify.population``

    Examples
    --------
    Twenty structures of standard deviation one, measured with errors of half of it:

    >>> rng = np.random.default_rng(1)
    >>> model = QuadraticModel(np.zeros(1), np.zeros(1), np.ones((1, 1)), np.zeros((1, 1, 1)))
    >>> rows = rng.standard_normal((20, 1)) + 0.5 * rng.standard_normal((20, 1))
    >>> found = sample_population(rows, np.array([[0.25]]), model, np.full(1, 10.0))
    >>> low, high = np.quantile(found.sd, [0.025, 0.975])
    >>> bool(low < 1.0 < high), found.individual.shape
    (True, (1000, 20, 1))
    """
    p, k = len(rows), len(scale)
    if p < k + 2:
        raise FemtuneError(
            "quantify.population", values={"structures": p, "parameters": k}, needed=k + 2
        )  # fmt: skip
    if not np.all(np.diag(noise) > 0.0):
        raise FemtuneError("quantify.population/noise")
    gibbs = _Gibbs.of(rows, noise, model, scale)
    rng = np.random.default_rng(rules.seed)
    chains = [gibbs.start(rng) for _ in range(rules.chains)]
    kept: list[list[_State]] = [[] for _ in chains]
    done, wanted = 0, rules.sweeps
    while True:
        every = max(1, wanted // (2 * rules.kept))
        while done < wanted:
            chains = [gibbs.sweep(state, rng) for state in chains]
            done += 1
            if done % every == 0:
                for one, state in zip(kept, chains):
                    one.append(state)
            if done % 500 == 0:
                tell(done, wanted)
        r_hat = _r_hat([one[len(one) // 2 :] for one in kept])
        if r_hat <= MIXED_POPULATION or wanted >= rules.most:
            break
        wanted *= 2
    last = [state for one in kept for state in one[len(one) // 2 :]]
    chosen = [last[i] for i in np.linspace(0, len(last) - 1, rules.kept).astype(int)]
    mean = np.array([s.mean for s in chosen])
    covariance = np.array([s.covariance for s in chosen])
    sd = np.sqrt(np.einsum("nii->ni", covariance))
    new = mean + np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), rng.standard_normal(mean.shape))
    each = np.array([s.each for s in chosen])
    misfit = gibbs.misfit(np.median(each, axis=0))
    # what parameters take of it: as many as the data determine, fewer the more structures are drawn to their mean
    taken = float(np.mean([gibbs.misfit(one) for one in each])) - misfit
    return PopulationSamples(
        mean=model.theta + scale * mean, sd=scale * sd,
        correlation=covariance / (sd[:, :, None] * sd[:, None, :]),
        individual=model.theta + scale * each, new=model.theta + scale * new,
        r_hat=r_hat, misfit=misfit, degrees=float(np.isfinite(rows).sum()) - taken,
        accepted=float(np.mean([s.accepted for s in last])),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _State:
    """Deviations from the middle of the model in units of the scale: of each structure, their mean and covariance."""

    each: Reals
    mean: Reals
    covariance: Reals
    mixing: Reals
    accepted: float = 1.0


@dataclass(frozen=True, eq=False)
class _Gibbs:
    """Conditional distributions.

    Parameters
    ----------
    weight : (p, m, m) inverse covariance of the errors of the outputs that were measured, zero for the others
    off : (p, m) measured outputs less those of the middle, zero where not measured
    J, H : (m, k) and (m, k, k) derivatives by the deviations
    slopes, rest : (p, m, k) and (p, m) outputs of each structure linearised where its own data put it, off ≈ slopes·d
        + errors + rest
    information, pull : (p, k, k) slopesᵀW slopes and (p, k) slopesᵀW (off − rest)
    """

    weight: Reals
    off: Reals
    J: Reals
    H: Reals
    slopes: Reals
    rest: Reals
    information: Reals
    pull: Reals

    @classmethod
    def of(cls, rows: Reals, noise: Reals, model: QuadraticModel, scale: Reals) -> _Gibbs:
        """In units of the scale."""
        known = np.isfinite(rows)
        weight = np.zeros((len(rows), *noise.shape))
        for i, here in enumerate(known):
            at = np.flatnonzero(here)
            weight[i][np.ix_(at, at)] = np.linalg.inv(noise[np.ix_(at, at)])
        J, H = model.G * scale, model.H * scale[:, None] * scale
        off = np.where(known, rows - model.z, 0.0)
        d = np.zeros((len(rows), len(scale)))
        # with small errors a structure is far from the middle in their units: its outputs are linear where it is
        for _ in range(_STEPS):
            slopes = J + np.einsum("mab,pb->pma", H, d)
            rest = 0.5 * np.einsum("mab,pa,pb->pm", H, d, d) - np.einsum("mab,pa,pb->pm", H, d, d)
            of_slopes = weight @ slopes
            information = np.swapaxes(slopes, 1, 2) @ of_slopes
            pull = np.einsum("pmk,pm->pk", of_slopes, off - rest)
            d = np.linalg.solve(information + np.eye(len(scale)), pull[:, :, None])[:, :, 0]
        return cls(weight, off, J, H, slopes, rest, information, pull)

    def misfit(self, each: Reals) -> float:
        """Sum of squares of all errors, in their standard deviations, with quadratic outputs."""
        left = self.off - each @ self.J.T - 0.5 * np.einsum("mab,pa,pb->pm", self.H, each, each)
        return float(np.einsum("pm,pmn,pn->", left, self.weight, left))

    def start(self, rng: np.random.Generator) -> _State:
        """Structures by their own data with a wide distribution, and a covariance of random size."""
        p, k = self.pull.shape
        size = np.exp(rng.uniform(np.log(0.01), 0.0))
        # not farther from the data than their errors: a structure whose linear outputs lie far off would stay there
        precision = self.information + np.eye(k) / size**2
        drawn = np.linalg.solve(np.swapaxes(np.linalg.cholesky(precision), 1, 2), rng.standard_normal((p, k, 1)))
        each = (np.linalg.solve(precision, self.pull[:, :, None]) + drawn)[:, :, 0]
        return _State(each, each.mean(axis=0), size**2 * np.eye(k), np.ones(k))

    def sweep(self, state: _State, rng: np.random.Generator) -> _State:
        """All of them once."""
        each, accepted = self._structures(state, rng)
        p, k = each.shape
        root = np.linalg.cholesky(state.covariance)
        mean = each.mean(axis=0) + root @ rng.standard_normal(k) / np.sqrt(p)
        each, mean = self._together(each, mean, rng)
        off = each - mean
        rate = off.T @ off + 2.0 * _DEGREES * np.diag(1.0 / state.mixing)
        precision = _wishart(_DEGREES + k - 1.0 + p, np.asarray(np.linalg.inv(rate), float), rng)
        mixing = (_DEGREES * np.diag(precision) + 1.0) / rng.gamma(0.5 * (_DEGREES + k), size=k)
        return _State(each, mean, np.asarray(np.linalg.inv(precision), float), mixing, accepted)

    def _structures(self, state: _State, rng: np.random.Generator) -> tuple[Reals, float]:
        """Parameters of each structure: proposed by the linear outputs, accepted by the quadratic ones."""
        precision = np.linalg.inv(state.covariance)
        root = np.linalg.cholesky(self.information + precision)
        right = self.pull + precision @ state.mean
        middle = np.linalg.solve(self.information + precision, right[:, :, None])[:, :, 0]
        drawn = rng.standard_normal(middle.shape)
        tried = middle + np.linalg.solve(np.swapaxes(root, 1, 2), drawn[:, :, None])[:, :, 0]
        if not self.H.any():
            return tried, 1.0
        gain = self._beyond_linear(tried) - self._beyond_linear(state.each)
        better = np.log(rng.random(len(gain))) < gain
        return np.where(better[:, None], tried, state.each), float(better.mean())

    def _beyond_linear(self, each: Reals) -> Reals:
        """(p,) log likelihood with quadratic outputs less that with linear ones."""
        quadratic = self.off - each @ self.J.T - 0.5 * np.einsum("mab,pa,pb->pm", self.H, each, each)
        linear = self.off - self.rest - np.einsum("pmk,pk->pm", self.slopes, each)
        both, apart = quadratic + linear, quadratic - linear
        return np.asarray(-0.5 * np.einsum("pm,pmn,pn->p", both, self.weight, apart))

    def _together(self, each: Reals, mean: Reals, rng: np.random.Generator) -> tuple[Reals, Reals]:
        """All structures and their mean moved by the same: given the deviations from the mean, the data tell it."""
        information = self.information.sum(axis=0)
        values, axes = np.linalg.eigh(information)
        told = values > 1e-12 * values.max()
        left = (self.pull - np.einsum("pij,pj->pi", self.information, each)).sum(axis=0)
        by_axis = np.zeros(len(values))
        by_axis[told] = (axes.T @ left)[told] / values[told]
        by_axis[told] += rng.standard_normal(int(told.sum())) / np.sqrt(values[told])
        moved = axes @ by_axis
        if self.H.any():
            gain = float(np.sum(self._beyond_linear(each + moved) - self._beyond_linear(each)))
            if np.log(rng.random()) >= gain:
                return each, mean
        return each + moved, mean + moved


def _wishart(degrees: float, scale: Reals, rng: np.random.Generator) -> Reals:
    """A sample of Wishart's distribution by the decomposition of Bartlett; SciPy's takes ten times as long."""
    k = len(scale)
    A = np.tril(rng.standard_normal((k, k)), -1)
    A[np.diag_indices(k)] = np.sqrt(rng.chisquare(degrees - np.arange(k)))
    L = np.linalg.cholesky(scale) @ A
    return np.asarray(L @ L.T)


def _r_hat(chains: list[list[_State]]) -> float:
    """Largest potential scale reduction of means and logarithms of standard deviations."""
    values = np.array([
        [np.concatenate([s.mean, 0.5 * np.log(np.diag(s.covariance))]) for s in one] for one in chains
    ])  # fmt: skip
    half = values.shape[1] // 2
    split = np.concatenate([values[:, :half], values[:, half : 2 * half]])
    within = split.var(axis=1, ddof=1).mean(axis=0)
    between = split.mean(axis=1).var(axis=0, ddof=1)
    return float(np.sqrt(1.0 - 1.0 / half + between / np.maximum(within, 1e-300)).max())
