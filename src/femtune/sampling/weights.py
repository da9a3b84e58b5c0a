"""Importance weights: smoothed tails, effective number of samples, evidence by bridge sampling.

Sources: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto smoothed importance sampling, Journal of Machine
Learning Research 25, 2024; J. Zhang, M. A. Stephens, A new and efficient estimation method for the generalized Pareto
distribution, Technometrics 51, 2009; X.-L. Meng, W. H. Wong, Simulating ratios of normalizing constants via a simple
identity, Statistica Sinica 6, 1996.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.special import gammaln

from femtune.arrays import Reals

_FEWEST_TAIL = 5
"""Largest weights that a Pareto distribution is fitted to, at least."""
_EQUAL = 1e-6
"""Excess relative to the largest weight below which the largest weights are equal."""
_PRIOR_K = (10.0, 0.5)
"""Weakly informative prior of k̂: as many draws at this value (Vehtari and others, appendix)."""


@dataclass(frozen=True, eq=False)
class SmoothedWeights:
    """Weights of n samples.

    Parameters
    ----------
    values : (n,) weights that sum to one
    k_hat : shape of the tail: below 0.7 averages converge as usual
    effective : effective number of samples 1/Σw²
    log_mean : logarithm of the mean of the weights before they were normalised
    log_mean_sd : its standard deviation
    """

    values: Reals
    k_hat: float
    effective: float
    log_mean: float
    log_mean_sd: float


def smoothed_weights(log_weights: Reals) -> SmoothedWeights:
    """Weights with a Pareto-smoothed tail.

    Parameters
    ----------
    log_weights : (n,); −∞ for samples that the model contradicts

    Examples
    --------
    >>> found = smoothed_weights(np.zeros(100))
    >>> round(found.effective), found.log_mean
    (100, 0.0)
    """
    n = len(log_weights)
    highest = float(np.max(log_weights))
    w = np.exp(log_weights - highest)
    tail = int(min(np.ceil(3.0 * np.sqrt(n)), n // 5))
    k_hat = np.inf
    if tail >= _FEWEST_TAIL:
        order = np.argsort(w, kind="stable")
        largest, cut = order[-tail:], float(w[order[-tail - 1]])
        excess = w[largest] - cut
        if excess[-1] <= _EQUAL:
            k_hat = 0.0
        else:
            k_hat, sigma = fitted_pareto(np.maximum(excess, np.finfo(float).tiny))
            p = (np.arange(tail) + 0.5) / tail
            smooth = -sigma * np.log1p(-p) if abs(k_hat) < 1e-9 else sigma * np.expm1(-k_hat * np.log1p(-p)) / k_hat
            w[largest] = np.minimum(cut + smooth, 1.0)
    mean = float(w.mean())
    values = w / w.sum()
    return SmoothedWeights(
        values, float(k_hat), float(1.0 / np.sum(values**2)), highest + float(np.log(mean)),
        float(w.std() / (mean * np.sqrt(n))),
    )  # fmt: skip


def fitted_pareto(excess: Reals) -> tuple[float, float]:
    """Shape k and scale σ of a generalised Pareto distribution of sorted excesses (m,).

    Examples
    --------
    >>> p = (np.arange(1000) + 0.5) / 1000
    >>> k, sigma = fitted_pareto(2.0 * np.expm1(-0.4 * np.log1p(-p)) / 0.4)
    >>> round(k, 1), round(sigma)
    (0.4, 2)
    """
    n = len(excess)
    count = 30 + int(np.sqrt(n))
    theta = 1.0 / excess[-1] + (1.0 - np.sqrt(count / (np.arange(1, count + 1) - 0.5))) / (
        3.0 * excess[int(np.floor(n / 4 + 0.5)) - 1]
    )
    k = np.mean(np.log1p(-theta[:, None] * excess), axis=1)
    profile = n * (np.log(-theta / k) - k - 1.0)
    with np.errstate(over="ignore"):
        share = 1.0 / np.sum(np.exp(profile - profile[:, None]), axis=1)
    keep = share >= 10.0 * np.finfo(float).eps
    best = float(np.sum(theta[keep] * share[keep]) / np.sum(share[keep]))
    shape = float(np.mean(np.log1p(-best * excess)))
    sigma = -shape / best
    return (n * shape + _PRIOR_K[0] * _PRIOR_K[1]) / (n + _PRIOR_K[0]), sigma


# ----------------------------------------------------------------------------------------------------
# The integral of a density that has been sampled.

_DEGREES = 8.0
"""Of the Student t distribution that is compared with: its tails are wider than those of most densities."""
_ITERATIONS = 100
"""Iterations of bridge sampling (Meng and Wong 1996) at most."""
_CONVERGED = 1e-8
"""Change of the logarithm of the integral at which the iteration ends: far below its standard deviation."""


def log_integral(z: Reals, log_density: Callable[[Reals], Reals], rng: np.random.Generator) -> tuple[float, float]:
    """Logarithm of the integral of a density, and its standard deviation, from samples (n, d) of it: bridge sampling.

    A Student t distribution is fitted to one half of the samples and compared with the other half.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> value, sd = log_integral(rng.standard_normal((4000, 3)), lambda z: -0.5 * np.sum(z**2, axis=1), rng)
    >>> abs(value - 1.5 * np.log(2.0 * np.pi)) < 4.0 * sd < 0.2
    True
    """
    half = len(z) // 2
    order = rng.permutation(len(z))
    fit, left = z[order[:half]], z[order[half:]]
    d = z.shape[1]
    centre, root = fit.mean(axis=0), la.cholesky(np.atleast_2d(np.cov(fit.T)), lower=True)
    # covariance of Student's t is its scale matrix times ν/(ν − 2)
    root = root * np.sqrt((_DEGREES - 2.0) / _DEGREES)
    log_det = float(np.log(np.diag(root)).sum())
    constant = float(
        gammaln(0.5 * (_DEGREES + d)) - gammaln(0.5 * _DEGREES) - 0.5 * d * np.log(_DEGREES * np.pi) - log_det
    )

    def log_t(points: Reals) -> Reals:
        y = la.solve_triangular(root, (points - centre).T, lower=True)
        return np.asarray(constant - 0.5 * (_DEGREES + d) * np.log1p(np.sum(y**2, axis=0) / _DEGREES))

    drawn = rng.standard_normal((len(left), d)) * np.sqrt(_DEGREES / rng.chisquare(_DEGREES, size=(len(left), 1)))
    other = centre + drawn @ root.T
    l_own, l_other = log_density(left) - log_t(left), log_density(other) - log_t(other)
    shift = float(np.median(l_own))
    a, b, r = l_own - shift, np.where(np.isfinite(l_other), l_other - shift, -np.inf), 0.0
    for _ in range(_ITERATIONS):
        # both numbers of samples are the same: f/(f + r g) and g/(f + r g)
        top = np.mean(1.0 / (1.0 + np.exp(np.clip(r - b, -700.0, 700.0))))
        bottom = np.mean(1.0 / (np.exp(np.clip(a, -700.0, 700.0)) + np.exp(r)))
        new = float(np.log(top) - np.log(bottom))
        if abs(new - r) < _CONVERGED:
            break
        r = new
    f1 = 1.0 / (1.0 + np.exp(np.clip(r - b, -700.0, 700.0)))
    f2 = 1.0 / (1.0 + np.exp(np.clip(a - r, -700.0, 700.0)))
    n = len(left)
    variance = float(f1.var() / (n * max(f1.mean(), 1e-300) ** 2) + f2.var() / (n * max(f2.mean(), 1e-300) ** 2))
    return r + shift, float(np.sqrt(variance))
