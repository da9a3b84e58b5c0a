"""Fisher information: how well each parameter would be known, alone and beside the others, and in which order to add.

F = SᵀS for residuals in units of their standard deviations and parameters in units of their priors'. Its inverse
bounds the covariance of any unbiased estimate (Cramér and Rao). Designs: D-optimal sets have the largest determinant,
A-optimal ones the least sum of variances (Atkinson, Donev and Tobias 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

KNOWN = 1.0 / 3.0
"""Standard deviation, in units of the prior's, below which the data alone tell a parameter."""


@dataclass(frozen=True)
class Information:
    """Of k parameters, all in units of their prior standard deviations.

    Parameters
    ----------
    matrix : (k, k) Fisher information F
    alone : (k,) standard deviation were all others known; inf without effect
    together : (k,) Cramér-Rao bound with all of them unknown and no prior; inf where undetermined
    d_order, a_order : positions, the parameter to update first in front: each next one makes the determinant of the
        information largest, or the sum of the variances of those taken smallest
    d_gain : (k,) standard deviation of each parameter of `d_order` beside those before it; inf where dependent
    a_sum : (k,) root of the sum of variances of the first ones of `a_order`; inf where dependent
    """

    names: tuple[str, ...]
    matrix: Reals
    alone: Reals
    together: Reals
    d_order: tuple[int, ...]
    d_gain: Reals
    a_order: tuple[int, ...]
    a_sum: Reals

    @property
    def known(self) -> tuple[str, ...]:
        """Names of the parameters that the data tell, whatever the others are."""
        return tuple(n for n, sd in zip(self.names, self.together) if sd <= KNOWN)

    @property
    def inflation(self) -> Reals:
        """(k,) how much wider a parameter is for the others being unknown; NaN without effect."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.together / self.alone)


def fisher_information(S: Reals, names: tuple[str, ...]) -> Information:
    """Of the scaled Jacobian S (n, k)."""
    F, k = S.T @ S, S.shape[1]
    size = np.linalg.norm(S, axis=0)
    with np.errstate(divide="ignore"):
        alone = 1.0 / size
    d_order, d_gain = _ordered(S, _d_next)
    a_order, a_sum = _ordered(S, _a_next)
    return Information(names, F, alone, _bounds(S, range(k)), d_order, d_gain, a_order, a_sum)


def _bounds(S: Reals, columns: range) -> Reals:
    """1/|s_j freed of all others| for each column."""
    out = np.full(len(columns), np.inf)
    for i in columns:
        others = np.delete(S, i, axis=1)
        out[i] = 1.0 / d if (d := _distance(others, S[:, i])) > 0.0 else np.inf
    return out


def _distance(columns: Reals, s: Reals) -> float:
    """Length of s freed of the columns; zero where it depends on them."""
    length = np.linalg.norm(columns, axis=0)
    u, values, _ = np.linalg.svd(columns[:, length > 0.0] / length[length > 0.0], full_matrices=False)
    u = u[:, values > 1e-10 * values.max(initial=0.0)]
    rest = s - u @ (u.T @ s)
    d = float(np.linalg.norm(rest))
    return d if d > 1e-9 * float(np.linalg.norm(s)) else 0.0


def _ordered(S: Reals, following: object) -> tuple[tuple[int, ...], Reals]:
    taken: list[int] = []
    sizes: list[float] = []
    while len(taken) < S.shape[1]:
        j, size = following(S, taken)  # type: ignore[operator]
        taken.append(j)
        sizes.append(size)
    return tuple(taken), np.array(sizes)


def _d_next(S: Reals, taken: list[int]) -> tuple[int, float]:
    """det grows by the squared length of the new column freed of the others."""
    open_ = [j for j in range(S.shape[1]) if j not in taken]
    lengths = [_distance(S[:, taken], S[:, j]) for j in open_]
    best = int(np.argmax(lengths))
    return open_[best], 1.0 / lengths[best] if lengths[best] > 0.0 else float("inf")


def _a_next(S: Reals, taken: list[int]) -> tuple[int, float]:
    open_ = [j for j in range(S.shape[1]) if j not in taken]
    sums = [_variance_sum(S[:, [*taken, j]]) for j in open_]
    best = int(np.argmin(sums))
    return open_[best], float(np.sqrt(sums[best]))


def _variance_sum(columns: Reals) -> float:
    if np.linalg.matrix_rank(columns, 1e-10 * np.linalg.norm(columns, axis=0).max(initial=0.0)) < columns.shape[1]:
        return float("inf")
    return float(np.sum(np.linalg.pinv(columns) ** 2))
