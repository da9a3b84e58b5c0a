"""Sensors for the parameters: the Fisher information that frequencies and shapes at the sensors give on a calibration.

Parameters are in units of their prior standard deviations. A frequency with the relative standard deviation σ_f adds
g gᵀ/σ_f² with g = ∂ln f/∂x. A shape is measured with noise of equal standard deviation s at all sensors and an unknown
scale, or an unknown rotation within a cluster of close modes. With rows Φ of the cluster's modes and ∂φ of the part of
the derivative outside of it the information is (∂φᵀ∂φ − ∂φᵀΦ(ΦᵀΦ)⁻¹Φᵀ∂φ)/s²: the scale is eliminated. The covariance
of the estimate is (1 + F)⁻¹ with the prior, and F⁻¹ without. Designs (Atkinson, Donev and Tobias 2007): D-optimal sets
have the largest determinant of 1 + F, A-optimal ones the smallest trace of its inverse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.planning.kinds import Average, Criterion

_NUISANCE = 1e-9
"""Information on a scale, relative to that of all candidates, below which it is unknown."""
_UNKNOWN = 1e-9
"""Relative eigenvalue of the information below which the data do not determine a combination of parameters."""
_CELLS = 30_000_000
"""Numbers in the temporary arrays of a comparison of candidates."""


@dataclass(frozen=True, eq=False)
class ClusterShapes:
    """Target modes of one cluster at sensors.

    Parameters
    ----------
    shapes : (s, d, q) all modes of the cluster
    slopes : (s, d, t, k) derivatives of its t target modes outside the cluster, per prior standard deviation
    noise : (t,) standard deviation of an entry of each, in the scale of the shapes
    """

    shapes: Reals
    slopes: Reals
    noise: Reals

    def select(self, which: Sequence[int] | slice) -> ClusterShapes:
        """At some of the sensors."""
        return ClusterShapes(self.shapes[which], self.slopes[which], self.noise)


@dataclass(frozen=True, eq=False)
class CalibrationPoint:
    """Information of a test about the parameters at one point of the prior.

    Parameters
    ----------
    frequencies : (k, k) information of the frequencies
    clusters : shapes at the candidates, or at a set of sensors
    """

    frequencies: Reals
    clusters: tuple[ClusterShapes, ...]

    def select(self, which: Sequence[int] | slice) -> CalibrationPoint:
        """At some of the sensors."""
        return CalibrationPoint(self.frequencies, tuple(c.select(which) for c in self.clusters))

    @property
    def information(self) -> Reals:
        """(k, k) F of the frequencies and of the shapes at all of its sensors."""
        return np.asarray(self.frequencies + sum(_Sums.of([c]).information for c in self.clusters))


def joined_information(parts: Sequence[CalibrationPoint]) -> Reals:
    """(k, k) F of several groups of sensors of the same point, each with its number of directions."""
    clusters = zip(*(p.clusters for p in parts))
    return np.asarray(parts[0].frequencies + sum(_Sums.of(same).information for same in clusters))


def expected_sd(information: Reals) -> Reals:
    """(k,) standard deviations with the prior, relative to those of the prior: √diag (1 + F)⁻¹.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import expected_sd
    >>> expected_sd(np.diag([0.0, 3.0, 99.0]))
    array([1. , 0.5, 0.1])
    """
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(np.eye(len(information)) + information))))


def data_sd(information: Reals) -> Reals:
    """(k,) standard deviations from the data alone, √diag F⁻¹; inf for what the data do not determine."""
    values, vectors = np.linalg.eigh(information)
    unknown = values <= _UNKNOWN * max(values[-1], 1.0)
    with np.errstate(divide="ignore"):
        out = (vectors[:, ~unknown] ** 2) @ (1.0 / values[~unknown])
    involved = (vectors[:, unknown] ** 2).sum(axis=1) > 1e-12
    return np.where(involved, np.inf, np.sqrt(out))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Of some sensors for one cluster: C = ΣΦᵀΦ (q, q), B = ΣΦᵀ∂φ (t, q, k), A = Σ∂φᵀ∂φ (t, k, k) over s²."""

    C: Reals
    B: Reals
    A: Reals
    noise: Reals

    @staticmethod
    def of(parts: Sequence[ClusterShapes]) -> _Sums:
        """Sums over groups of sensors."""
        C = sum(np.einsum("sdq,sdr->qr", p.shapes, p.shapes) for p in parts)
        B = sum(np.einsum("sdq,sdtk->tqk", p.shapes, p.slopes) for p in parts)
        A = sum(np.einsum("sdtk,sdtl->tkl", p.slopes, p.slopes) for p in parts)
        return _Sums(np.asarray(C), np.asarray(B), np.asarray(A), parts[0].noise)

    @property
    def information(self) -> Reals:
        """(k, k) with the scales eliminated."""
        inverse = np.linalg.pinv(self.C, rcond=1e-12, hermitian=True)
        left = self.A - np.einsum("tqk,qr,trl->tkl", self.B, inverse, self.B)
        return np.asarray(np.einsum("tkl,t->kl", left, self.noise**-2.0))


class CalibrationObjective:
    """Scores of candidates by the calibration: a set with the larger score determines the parameters better.

    Parameters
    ----------
    points : the candidates at one or several points of the prior
    placed : sensors that are there, at each point, in groups of equal numbers of directions
    criterion : "D" for log det(1 + F), "A" for −trace (1 + F)⁻¹
    average : over the points, or the worst of them
    """

    def __init__(
        self,
        points: Sequence[CalibrationPoint],
        placed: Sequence[Sequence[CalibrationPoint]] = (),
        criterion: Criterion = "D",
        average: Average = "mean",
    ) -> None:
        self._points, self._placed = points, placed or [()] * len(points)
        self._criterion, self._average = criterion, average
        self._least = [
            [_NUISANCE * float(np.einsum("sdq,sdq->", c.shapes, c.shapes)) for c in p.clusters] for p in points
        ]

    def scores(self, chosen: Sequence[int]) -> Reals:
        """(s,) score of the chosen sensors with each candidate added."""
        return combined([self._of_point(i, list(chosen)) for i in range(len(self._points))], self._average)

    def _of_point(self, i: int, chosen: list[int]) -> Reals:
        point, placed = self._points[i], self._placed[i]
        F = np.eye(len(point.frequencies)) + point.frequencies
        gains: list[tuple[ClusterShapes, Reals, Reals]] = []
        for j, cluster in enumerate(point.clusters):
            sums = _Sums.of([cluster.select(chosen), *(p.clusters[j] for p in placed)])
            # while the scale is unknown, a sensor only helps to find it
            C = sums.C + self._least[i][j] * np.eye(len(sums.C))
            slope = np.linalg.solve(C, sums.B)
            F = F + np.einsum("tkl,t->kl", sums.A - np.einsum("tqk,tql->tkl", sums.B, slope), cluster.noise**-2.0)
            gains.append((cluster, np.asarray(np.linalg.inv(C)), np.asarray(slope)))
        k = len(F)
        values = np.empty(len(point.clusters[0].shapes))
        rows = max(1, _CELLS // (k * k + k * sum(c.slopes[0].size // k for c in point.clusters)))
        for first in range(0, len(values), rows):
            some = slice(first, first + rows)
            more = np.asarray(sum(_gain(c.select(some), inverse, slope) for c, inverse, slope in gains))
            values[some] = score(F + more, self._criterion)
        return values


def score(with_prior: Reals, criterion: Criterion) -> Reals:
    """(s,) log det(1 + F) or −trace (1 + F)⁻¹ of matrices 1 + F (s, k, k)."""
    if criterion == "D":
        return np.asarray(np.linalg.slogdet(with_prior)[1])
    return np.asarray(-np.trace(np.linalg.inv(with_prior), axis1=-2, axis2=-1))


def combined(scores: Sequence[Reals], average: Average) -> Reals:
    """The mean over the points of the prior, or the worst of them."""
    return np.asarray(np.mean(scores, axis=0) if average == "mean" else np.min(scores, axis=0))


class SumObjective:
    """Scores of candidates whose information adds up, such as that of FRFs with independent errors.

    Parameters
    ----------
    points : (s, k, k) information of each candidate, at one or several points of the prior
    fixed : (k, k) information that is there, at each point
    criterion, average : as for `CalibrationObjective`
    """

    def __init__(
        self, points: Sequence[Reals], fixed: Sequence[Reals], criterion: Criterion = "D", average: Average = "mean"
    ) -> None:
        self._points, self._fixed, self._criterion, self._average = points, fixed, criterion, average

    def scores(self, chosen: Sequence[int]) -> Reals:
        """(s,) score of the chosen candidates with each candidate added."""
        each = []
        for own, there in zip(self._points, self._fixed):
            F = np.eye(len(there)) + there + own[list(chosen)].sum(axis=0)
            each.append(score(F + own, self._criterion))
        return combined(each, self._average)


def _gain(cluster: ClusterShapes, inverse: Reals, slope: Reals) -> Reals:
    """(s, k, k) what each sensor adds: rows ∂φ − ΦC⁻¹B, weighted by (1 + ΦC⁻¹Φᵀ)⁻¹."""
    left = cluster.slopes - np.einsum("sdq,tqk->sdtk", cluster.shapes, slope)
    d = cluster.shapes.shape[1]
    weight = np.linalg.inv(np.eye(d) + np.einsum("sdq,qr,ser->sde", cluster.shapes, inverse, cluster.shapes))
    scaled = left / cluster.noise[:, None]
    s, _, t, k = scaled.shape
    one = scaled.transpose(0, 2, 1, 3).reshape(s, t * d, k)
    other = np.einsum("sde,setk->stdk", weight, scaled).reshape(s, t * d, k)
    return np.asarray(np.swapaxes(one, 1, 2) @ other)
