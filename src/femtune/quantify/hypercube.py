"""Latin hypercube samples of a normal distribution with imposed correlation.

Every parameter's range is cut into as many strata of equal probability as there are samples, and each stratum is met
once (McKay, Beckman and Conover 1979). The correlation is imposed by re-ordering the ranks (Iman and Conover 1982),
which leaves every parameter's strata as they are, or by a linear map of the normal scores after which mean and
covariance of the sample are those asked for, exactly.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from femtune.errors import FemtuneError
from femtune.quantify.covariance_matrix import check_positive, correlation_of, factor

Reals = NDArray[np.float64]
Imposed = Literal["ranks", "moments"]


def latin_hypercube(mean: Reals, covariance: Reals, count: int, seed: int = 0, imposed: Imposed = "moments") -> Reals:
    """(count, k) samples of a normal distribution.

    Parameters
    ----------
    mean, covariance : (k,) and (k, k)
    count : number of samples, more than k
    seed : of the permutations and of the places within the strata
    imposed : "moments": sample mean and covariance are exactly those asked for; "ranks": strata are kept exactly and
        the correlation is met as nearly as ranks can

    Raises
    ------
    FemtuneError : ``quantify.not-positive``, ``quantify.too-few-samples``
    """
    check_positive(covariance, "the covariance of the parameters")
    if count <= len(mean) + 1:
        raise FemtuneError(
            "quantify.too-few-samples",
            "a correlation cannot be imposed on so few samples",
            values={"samples": count, "parameters": len(mean)},
            hint="ask for ten times as many samples as parameters at the least",
        )
    scores = _scores(count, len(mean), np.random.default_rng(seed))
    if imposed == "moments":
        return np.asarray(mean + _white(scores) @ factor(covariance).T)
    sd = np.sqrt(np.diag(covariance))
    return np.asarray(mean + sd * _ranked(scores, factor(correlation_of(covariance))))


def _scores(n: int, k: int, rng: np.random.Generator) -> Reals:
    """Normal scores (n, k), one in each stratum of probability 1/n, in random order."""
    strata = np.column_stack([rng.permutation(n) for _ in range(k)])
    return np.asarray(norm.ppf((strata + rng.uniform(size=(n, k))) / n))


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
