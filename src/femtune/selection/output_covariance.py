"""Identification of varying parameters from the leading space of the output covariance.

With independent parameters Cov z̃ = Σ σ_j² s̃_j s̃_jᵀ: the covariance of outputs that are scaled by their means is a sum
of rank-one matrices of the varying parameters, so that their columns lie in its range and others do not.

Source: Silva, Maia, Link and Mottershead (2016). The rank is estimated, and the threshold follows the covariance:
for each rank the columns are sorted by distance, and the rank is taken at which as many independent columns stand apart
from the next one and leave little of the covariance unexplained (the product of both is least).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError

_EXACT_DISTANCE = 1e-10
"""Distance of an effect from the space of the measured covariance that is rounding; margins are ratios of distances."""
_CLEAR_MARGIN = 0.25
"""Ratio of the distances on both sides of a gap, up to which the gap separates parameters."""
_FAR_DISTANCE = 0.1
"""Distance beyond which effects do not lie near the space, whatever the gap."""
_INSENSITIVE = 1e-12
"""Size of an effect relative to the largest, at or below which a parameter has none."""
_ROUNDING = 1e-14
"""Eigenvalue of a covariance relative to the largest, and share of the variance, that is rounding of a double."""
_DEPENDENT = 1e-7
"""Singular value of unit effects relative to the largest, at or below which they are dependent: half of the digits of a
double."""


@dataclass(frozen=True)
class CosineDistances:
    """Distance of each of k columns from the leading space of the output covariance.

    Parameters
    ----------
    distance : (k,) 1 − cos between a column and its projection; 0 for a column without any effect
    insensitive : (k,) True where no output depends on the parameter, so that nothing can be said of it
    rank : dimension of the leading space
    threshold : geometric mean of the distances on both sides of the gap
    margin : distance of the farthest column inside by that of the nearest outside; near 1 nothing separates them
    unexplained : share of the scaled outputs' variance outside the span of the columns inside
    eigenvalues : (m,) of the scaled covariance, descending
    """

    names: tuple[str, ...]
    distance: Reals
    insensitive: NDArray[np.bool_]
    rank: int
    threshold: float
    margin: float
    unexplained: float
    eigenvalues: Reals

    @property
    def scatters(self) -> tuple[str, ...]:
        """Names of the parameters whose columns lie in the leading space."""
        inside = (self.distance <= self.threshold) & ~self.insensitive
        return tuple(n for n, yes in zip(self.names, inside) if yes)

    @property
    def clear(self) -> bool:
        """True where a gap separates the varying parameters from the others, and they lie near the space."""
        return self.margin <= _CLEAR_MARGIN and self.threshold <= _FAR_DISTANCE

    @property
    def sentences(self) -> tuple[str, ...]:
        """The verdict, and what it does not cover."""
        which = ", ".join(self.scatters) or "none"
        sentence = f"The output covariance has rank {self.rank}; these parameters explain it: {which}."
        if not self.clear:
            sentence = (
                f"The output covariance does not clearly identify a set of these parameters; the nearest are {which}. "
                "A parameter that varies is not among the candidates, or the variations are too large for "
                "first-order sensitivities."
            )
        blind = [n for n, yes in zip(self.names, self.insensitive) if yes]
        return (
            sentence,
            *([f"No output depends on {', '.join(blind)}; the data give no information on them."] if blind else []),
        )


def cosine_distances(
    covariance: Reals, mean: Reals, jacobian: Reals, values: Reals, names: tuple[str, ...], rank: int | None = None
) -> CosineDistances:
    """Distances of the scaled columns s̃_j = (θ_j/z_i) ∂z_i/∂θ_j from the range of the scaled output covariance.

    An output whose mean is not larger than its standard deviation, zero for one, has no relative scale. It is scaled
    such that its standard deviation is the root mean square of the relative ones of the other outputs. The scale of a
    parameter does not change the direction of its column: one whose value is zero is scaled by its unit.

    Parameters
    ----------
    covariance, mean : (m, m), (m,) of the outputs
    jacobian : (m, k) ∂z/∂θ
    values : (k,) θ
    rank : dimension of the leading space, estimated where None

    Raises
    ------
    FemtuneError : ``select.covariance`` for a zero covariance or one of another size, values that are not finite, an
        output whose mean and variance are zero, and where no output depends on a parameter
    """
    _check(covariance, mean, jacobian, values)
    scale = _scales(covariance, mean)
    S, C = jacobian * np.where(values == 0.0, 1.0, values) / scale[:, None], covariance / np.outer(scale, scale)
    size = np.linalg.norm(S, axis=0)
    # lengths in units of parameters cannot be compared with relative ones
    blind = np.where(values == 0.0, size == 0.0, size <= _INSENSITIVE * size[values != 0.0].max(initial=0.0))
    if blind.all():
        raise FemtuneError("select.covariance/no-effect", values={"parameters": ", ".join(names)})
    unit, sensitive = S / np.where(blind, 1.0, size), np.flatnonzero(~blind)
    tried = [_at_rank(C, unit[:, sensitive], r) for r in (_possible(C, sensitive) if rank is None else [rank])]
    best = min(tried, key=lambda t: t.margin * max(t.unexplained, _ROUNDING))
    distance = np.zeros(len(names))
    distance[sensitive] = best.distance
    eigenvalues = np.maximum(np.linalg.eigvalsh(C)[::-1], 0.0)
    return CosineDistances(
        names, distance, blind, best.rank, best.threshold, best.margin, best.unexplained, eigenvalues
    )  # fmt: skip


def _check(covariance: Reals, mean: Reals, jacobian: Reals, values: Reals) -> None:
    m = len(mean)
    sizes = {"covariance": covariance.shape, "outputs": m, "sensitivities": jacobian.shape}
    if covariance.shape != (m, m) or len(jacobian) != m:
        raise FemtuneError("select.covariance", values=sizes)
    if not all(np.isfinite(a).all() for a in (covariance, mean, jacobian, values)):
        raise FemtuneError("select.covariance/not-finite", values=sizes)
    if not np.trace(covariance) > 0.0:
        raise FemtuneError("select.covariance", values=sizes)


def _scales(covariance: Reals, mean: Reals) -> Reals:
    """(m,) means of the outputs, and of those without a relative scale what gives them a usual deviation."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    without = np.abs(mean) <= sd
    lost = np.flatnonzero(without & (sd == 0.0))
    if lost.size:
        raise FemtuneError("select.covariance/zero-output", output=int(lost[0]) + 1)
    relative = sd[~without] / mean[~without]
    usual = float(np.sqrt(np.mean(relative**2))) if relative.any() else 1.0
    return np.where(without, sd / usual, mean)


@dataclass(frozen=True)
class _Tried:
    rank: int
    distance: Reals
    threshold: float
    margin: float
    unexplained: float


def _possible(C: Reals, own: NDArray[np.int64]) -> range:
    """Ranks to try, at most half of the outputs: a larger space holds columns by chance."""
    eigenvalues = np.linalg.eigvalsh(C)
    largest = int((eigenvalues > _ROUNDING * eigenvalues[-1]).sum())
    return range(1, 1 + max(1, min(len(C) // 2, largest, len(own))))


def _at_rank(C: Reals, unit: Reals, rank: int) -> _Tried:
    """Threshold and margin between the nearest columns, as many as have this rank, and the others.

    Parameters of a symmetric structure share columns, so that there may be more of them than the rank.
    """
    distance = _distances(np.linalg.eigh(C)[1][:, ::-1][:, :rank], unit)
    order = np.argsort(distance)
    ranks = [np.linalg.matrix_rank(unit[:, order[: n + 1]], _DEPENDENT) for n in range(len(order))]
    count = int(np.searchsorted(ranks, rank, side="right"))
    inside = max(float(distance[order[count - 1]]), _EXACT_DISTANCE)
    outside = max(float(distance[order[count]]) if count < len(order) else 1.0, _EXACT_DISTANCE)
    left = _left(C, unit[:, order[:count]])
    return _Tried(rank, distance, float(np.sqrt(inside * outside)), inside / outside, left)


def _left(C: Reals, columns: Reals) -> float:
    """Share of the covariance outside the span of columns."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    u = u[:, s > _DEPENDENT * s[0]]
    return max(0.0, 1.0 - float(np.trace(u.T @ C @ u) / np.trace(C)))


def _distances(space: Reals, unit: Reals) -> Reals:
    # 1 − cos of a small angle from its sine, which has not lost its digits
    inside = space.T @ unit
    sine = np.linalg.norm(unit - space @ inside, axis=0)
    return np.asarray(sine**2 / (1.0 + np.linalg.norm(inside, axis=0)))
