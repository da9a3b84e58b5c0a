"""Candidate models: which of several sets of parameters is supported by the data.

Every candidate is the same structure with other parameters to update. They are compared by what they leave of the
residuals, by criteria that charge for parameters, and by their parameters.

Sources: G. Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978; J. L. Beck, K.-V. Yuen, Model
selection using response measurements: Bayesian probabilistic approach, Journal of Engineering Mechanics 130, 2004;
J.-A. Goulet, I. F. C. Smith, Structural identification with systematic errors and unknown uncertainty dependencies,
Computers and Structures 128, 2013 (falsification with the limits of Šidák).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from scipy.special import ndtri

from femtune.arrays import Flags, Integers, Reals
from femtune.residuals.kinds import Scatter
from femtune.selection.evidence import LinearFit, log_evidence

_EXACT = 1e-30
"""Sum of squares of residuals that are zero up to rounding."""

Group = tuple[str, ...]
"""Parameters that are updated together or not at all."""


@dataclass(frozen=True, eq=False)
class CandidateFit:
    """The optimum of a candidate.

    Parameters
    ----------
    chi2 : rᵀr
    residuals : number of independent residuals
    rank : number of combinations that the data determine
    linear : residuals near the optimum, with bounds and priors of the parameters that move
    place : (p,) all parameters of the study, relative to their nominal values
    worst : smallest largest absolute residual of all values of the parameters, see `smallest_largest`
    error : weighted mean error, the smallest of the candidate and those that it contains
    """

    chi2: float
    residuals: int
    rank: int
    linear: LinearFit
    place: Reals
    worst: float
    error: float


@dataclass(frozen=True, eq=False)
class CandidateRanking:
    """Comparison of m candidates.

    Parameters
    ----------
    size : standard deviation of the residuals in units of the stated one
    comparable : (m,) candidates that compare as many residuals as most of them; the others have NaN below
    bic : (m,) Bayesian information criterion; only differences count
    bic_weights : (m,) relative support by BIC, of sum 1
    log_evidence : (m,) logarithm of the evidence, with the residuals linear near the optimum; only differences count
    probabilities : (m,) of the candidates, by their evidence, if all are equally probable beforehand
    limit : largest absolute residual of an admissible model, in stated standard deviations; None with a threshold
    admissible : (m,)
    distances : (m, m) root mean square difference of the relative parameters
    clusters : (m,) number of the cluster of an admissible candidate from 1, in the order of their residuals; others 0
    """

    size: float
    comparable: Flags
    bic: Reals
    bic_weights: Reals
    log_evidence: Reals
    probabilities: Reals
    limit: float | None
    admissible: Flags
    distances: Reals
    clusters: Integers


def rank_candidates(
    fits: Sequence[CandidateFit],
    *,
    scatter: Scatter = "stated",
    threshold: float | None = None,
    probability: float = 0.95,
    cluster_distance: float = 0.05,
) -> CandidateRanking:
    """Criteria of all candidates.

    With n residuals, k determined combinations of parameters and residuals r in their standard deviations:

    - BIC = rᵀr + k ln n; with estimated scatter n ln(rᵀr/n) + k ln n;
    - ln Z, see `log_evidence`, with s = 1, or with estimated scatter that of the candidate of the least variance
      rᵀr/(n − k), for all;
    - a candidate is admissible if its weighted mean error is at most `threshold` times the smallest one; without a
      threshold, if some values of its parameters let no residual exceed s·z, z being exceeded by none of n normal
      numbers with the stated probability. So a candidate that contains an admissible one is admissible.

    Parameters
    ----------
    scatter : "stated" if the standard deviations of the residuals are known, "estimated" if they are relative weights
    threshold : largest weighted mean error of an admissible model, relative to the smallest one
    probability : with which a right model is admissible
    cluster_distance : mean distance of two clusters below which they are one

    Examples
    --------
    >>> free = [np.zeros(2), -np.ones(2), np.ones(2), np.zeros(2), np.full(2, np.inf)]
    >>> first = LinearFit(np.array([[81.0]]), *(part[:1] for part in free))
    >>> one = CandidateFit(50.0, 40, 1, first, np.array([0.9, 1.0]), 3.9, 0.02)
    >>> two = CandidateFit(36.0, 40, 2, LinearFit(np.diag([81.0, 25.0]), *free), np.array([0.8, 1.2]), 2.1, 0.01)
    >>> found = rank_candidates([one, two])
    >>> found.bic.round(1), found.admissible, round(found.limit, 2)
    (array([53.7, 43.4]), array([False,  True]), 3.22)
    """
    n = np.array([fit.residuals for fit in fits])
    chi2, k = np.array([fit.chi2 for fit in fits]), np.array([fit.rank for fit in fits])
    values, counts = np.unique(n, return_counts=True)
    usual = int(values[len(values) - 1 - np.argmax(counts[::-1])])
    comparable = n == usual
    size = 1.0
    if scatter == "estimated":
        spare = np.maximum(usual - k, 1)
        size = float(np.sqrt(max(np.min((chi2 / spare)[comparable]), _EXACT)))
    misfit = chi2 if scatter == "stated" else usual * np.log(np.maximum(chi2, _EXACT) / usual)
    bic = np.where(comparable, misfit + k * np.log(usual), np.nan)
    evidence = np.array([log_evidence(fit.chi2, fit.linear, size) for fit in fits])
    evidence = np.where(comparable, evidence, np.nan)
    limit = None
    if threshold is None:
        limit = size * largest_of_right(usual, probability)
        admissible = comparable & (np.array([fit.worst for fit in fits]) <= limit)
    else:
        errors = np.array([fit.error for fit in fits])
        admissible = comparable & (errors <= threshold * errors[comparable].min())
    places = np.array([fit.place for fit in fits])
    distances = np.sqrt(np.mean((places[:, None] - places[None]) ** 2, axis=2))
    return CandidateRanking(
        size=size,
        comparable=comparable,
        bic=bic,
        bic_weights=evidence_weights(-0.5 * bic),
        log_evidence=evidence,
        probabilities=evidence_weights(evidence),
        limit=limit,
        admissible=admissible,
        distances=distances,
        clusters=_clusters(distances, admissible, chi2, cluster_distance),
    )


def largest_of_right(n: int, probability: float) -> float:
    """What none of n standard normal numbers exceeds in size with a probability (Šidák)."""
    return float(ndtri(0.5 + 0.5 * probability ** (1.0 / max(n, 1))))


def evidence_weights(logarithms: Reals) -> Reals:
    """exp of logarithms (m,), of sum 1; NaN stays."""
    if np.isnan(logarithms).all():
        return logarithms
    parts = np.exp(logarithms - np.nanmax(logarithms))
    return np.asarray(parts / np.nansum(parts))


def _clusters(distances: Reals, admissible: Flags, chi2: Reals, reach: float) -> Integers:
    """Clusters by average linkage, numbered by their least objective."""
    cluster_of = np.zeros(len(distances), dtype=np.int64)
    chosen = np.flatnonzero(admissible)
    if len(chosen) < 2:
        cluster_of[chosen] = 1
        return cluster_of
    # a tenth of a second that only candidates need
    from scipy.cluster.hierarchy import fcluster, linkage  # noqa: PLC0415
    from scipy.spatial.distance import squareform  # noqa: PLC0415

    tree = linkage(squareform(distances[np.ix_(chosen, chosen)], checks=False), "average")
    labels = fcluster(tree, reach, "distance")
    order = list(dict.fromkeys(labels[np.argsort(chi2[chosen], kind="stable")]))
    cluster_of[chosen] = [order.index(label) + 1 for label in labels]
    return cluster_of


def subsets(groups: Sequence[Group], least: int, most: int) -> Iterator[tuple[Group, ...]]:
    """All sets of `least` to `most` groups, small ones first.

    Examples
    --------
    >>> [len(s) for s in subsets([("a",), ("b", "c")], 1, 2)]
    [1, 1, 2]
    """
    for size in range(least, most + 1):
        yield from combinations(groups, size)


def subset_count(groups: int, least: int, most: int) -> int:
    """Number of sets of `subsets`."""
    return sum(comb(groups, size) for size in range(least, most + 1))
