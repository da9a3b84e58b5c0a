"""Do repeated tests depend on their order? Drift, a jump and serial correlation, by permutation.

Independent repeats have the same distribution in any order. Each output is replaced by the normal scores of its ranks,
which limits the effect of outliers and makes the result independent of the units; missing values have score 0. The
scores are decorrelated with their correlation matrix, which is shrunk to the identity by outputs/repeats. Three
statistics of the decorrelated scores w_i of the repeats in their order are computed:

- drift: sum of squares that a straight line explains, |Σ t_i w_i|²/Σ t_i² (that of Hotelling in a regression on order);
- jump: the largest sum of squares that two different means explain, over all places of the jump;
- serial correlation: the von Neumann ratio Σ |w_{i+1} − w_i|²/Σ |w_i|², which is small.

Drift and jump are also sought in single outputs, by the largest statistic of all outputs: decorrelation hides a common
change of few repeats. The p-values of the five statistics are those of random permutations of the order, corrected for
being the smallest of five (Westfall and Young 1993). The test that names single outputs uses the same permutations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.special import ndtri

from femtune.arrays import Integers, Reals

LEVEL = 0.05
"""Significance level."""
FEWEST = 8
"""Repeats for a test: both sides of a jump have three at least, and some orders remain."""
_PERMUTATIONS = 999
"""Orders drawn at random: with the observed one they make p-values multiples of 0.001."""
_SEED = 0
"""Of these orders: the same data give the same p-value."""
_EDGE = 3
"""Repeats on each side of a jump at least; the mean of fewer says little."""
_TIE_FACTOR = 1.0 - 1e-10
"""Factor below one on an observed statistic, so that rounding does not break ties with permuted ones."""

Kind = Literal["drift", "jump", "serial correlation"]


@dataclass(frozen=True)
class OrderDependence:
    """Result of the tests of n repeats of m outputs.

    Parameters
    ----------
    p_values : of drift, jump and serial correlation, each corrected for all tests
    kind : the dependence that explains most where any is significant, None otherwise
    jump_after : number of repeats before the most likely jump
    change : (m,) change of each output: of a straight line from the first to the last repeat, or of the medians at the
        jump, in the unit of the output; outliers have little effect on it
    outputs : positions of the outputs that change significantly by themselves, the level corrected for m outputs
    """

    p_values: dict[Kind, float]
    kind: Kind | None
    jump_after: int
    change: Reals
    outputs: Integers

    @property
    def p_value(self) -> float:
        """Probability that repeats without any dependence on order have as small a p-value in any of the tests."""
        return min(self.p_values.values())


def order_dependence(table: Reals) -> OrderDependence | None:
    """Test of repeats (n, m) in their order, NaN where a value was not measured; None for fewer than eight repeats.

    Source: Good (2005), Permutation, Parametric and Bootstrap Tests of Hypotheses; Westfall and Young (1993),
    Resampling-Based Multiple Testing; James, James and Siegmund (1987), Biometrika 74, 71-83, for the jump.

    Examples
    --------
    >>> import numpy as np
    >>> table = np.random.default_rng(3).normal(size=(30, 2))
    >>> order_dependence(table).kind is None
    True
    >>> order_dependence(table + 0.1 * np.arange(30)[:, None]).kind
    'drift'
    """
    n = len(table)
    if n < FEWEST:
        return None
    scores = normal_scores(table)
    rng = np.random.default_rng(_SEED)
    orders = np.vstack([np.arange(n), *(rng.permutation(n) for _ in range(_PERMUTATIONS))])
    white, single = _Explained(_decorrelated(scores), orders), [_Explained(c[:, None], orders) for c in scores.T]
    together = _Explained.largest(single)
    tests = (white.drift, together.drift, white.jump, together.jump, -serial_statistic(white.scores, orders))
    p = corrected(np.stack(tests))
    by_kind: dict[Kind, float] = {"drift": min(p[:2]), "jump": min(p[2:4]), "serial correlation": p[4]}
    seen = white if min(p[0], p[2]) <= min(p[1], p[3]) else together
    kind = _kind(by_kind, seen)
    largest, *of_outputs = (e.jump if kind == "jump" else e.drift for e in (together, *single))
    outputs = [i for i, values in enumerate(of_outputs) if np.mean(largest >= values[0] * _TIE_FACTOR) <= LEVEL]
    change = _jump(table, seen.after) if kind == "jump" else _slope(table)
    return OrderDependence(by_kind, kind, seen.after, change, np.array(outputs, dtype=np.int64))


@dataclass(frozen=True)
class _Explained:
    """Sums of squares of scores (n, m) that a straight line and two means explain, for each order.

    Parameters
    ----------
    scores : (n, m)
    orders : (orders, n), the measured one first
    """

    scores: Reals
    orders: Integers

    @cached_property
    def drift(self) -> Reals:
        """(orders,)."""
        return drift_statistic(self.scores, self.orders)

    @cached_property
    def jumps(self) -> Reals:
        """(orders, places)."""
        return jump_statistics(self.scores, self.orders)

    @cached_property
    def jump(self) -> Reals:
        """(orders,) at the most likely place."""
        return np.asarray(self.jumps.max(axis=1))

    @property
    def after(self) -> int:
        """Number of repeats before the most likely jump."""
        return _EDGE + int(self.jumps[0].argmax())

    @classmethod
    def largest(cls, parts: list[_Explained]) -> _Explained:
        """The largest values of several."""
        out = cls(np.hstack([p.scores for p in parts]), parts[0].orders)
        # cached properties in place of those that would follow from the scores of all outputs together
        object.__setattr__(out, "drift", np.max([p.drift for p in parts], axis=0))
        object.__setattr__(out, "jumps", np.max([p.jumps for p in parts], axis=0))
        return out


def _kind(p: dict[Kind, float], seen: _Explained) -> Kind | None:
    """The alternative that explains most beyond chance: three quarters of a drift look like a jump, and vice versa."""
    if min(p.values()) > LEVEL:
        return None
    if min(p["drift"], p["jump"]) > LEVEL:
        return "serial correlation"
    drift, jump = (float(s[0] - np.median(s)) for s in (seen.drift, seen.jump))
    return "drift" if drift >= jump else "jump"


def normal_scores(table: Reals) -> Reals:
    """(n, m) normal scores of the ranks of each column, of zero mean and unit mean square; 0 for missing values."""
    scores = np.zeros_like(table)
    for j, column in enumerate(table.T):
        known = np.flatnonzero(np.isfinite(column))
        _, at, counts = np.unique(column[known], return_inverse=True, return_counts=True)
        ranks = (np.cumsum(counts) - 0.5 * (counts - 1.0))[at]
        normal = ndtri((ranks - 0.375) / (len(known) + 0.25))
        size = np.sqrt(np.mean((normal - normal.mean()) ** 2))
        scores[known, j] = (normal - normal.mean()) / (size or 1.0)
    return scores


def _decorrelated(scores: Reals) -> Reals:
    n, m = scores.shape
    share = min(1.0, m / n)
    correlation = (1.0 - share) * scores.T @ scores / n + share * np.eye(m)
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(scores @ (vectors / np.sqrt(values)))


def _times(n: int) -> Reals:
    t = np.arange(n) - 0.5 * (n - 1)
    return np.asarray(t / np.linalg.norm(t))


def drift_statistic(white: Reals, orders: Integers) -> Reals:
    """(orders,) sum of squares explained by a straight line."""
    along = np.zeros((len(orders), len(white)))
    np.put_along_axis(along, orders, np.broadcast_to(_times(len(white)), orders.shape), axis=1)
    return np.asarray(((along @ white) ** 2).sum(axis=1))


def jump_statistics(white: Reals, orders: Integers) -> Reals:
    """(orders, places) sums of squares explained by two means, with at least three repeats on each side."""
    n = len(white)
    before = np.arange(_EDGE, n - _EDGE + 1)
    weight = n / (before * (n - before))
    explained = np.zeros((len(orders), len(before)))
    for column in (white - white.mean(axis=0)).T:
        explained += weight * np.cumsum(column[orders], axis=1)[:, before - 1] ** 2
    return explained


def serial_statistic(white: Reals, orders: Integers) -> Reals:
    """(orders,) von Neumann ratios."""
    squares = np.zeros(len(orders))
    for column in white.T:
        squares += (np.diff(column[orders], axis=1) ** 2).sum(axis=1)
    return squares / (white**2).sum()


def corrected(statistics: Reals) -> list[float]:
    """p-values of the first column of statistics (tests, orders), corrected for the number of tests."""
    ranks = np.array([_shares(row) for row in statistics])
    smallest = ranks.min(axis=0)
    return [float(np.mean(smallest <= p)) for p in ranks[:, 0]]


def _shares(statistic: Reals) -> Reals:
    """For each order the share of all orders whose statistic is as large; equal to rounding is equal."""
    rounded = np.round(statistic / (np.abs(statistic).max() or 1.0), 10)
    return np.asarray(1.0 - np.searchsorted(np.sort(rounded), rounded, side="left") / len(rounded))


def _slope(table: Reals) -> Reals:
    """(m,) change from the first repeat to the last, by the median slope of all pairs (Theil and Sen)."""
    out = []
    for column in table.T:
        known = np.flatnonzero(np.isfinite(column))
        i, j = np.triu_indices(len(known), 1)
        slopes = (column[known[j]] - column[known[i]]) / (known[j] - known[i])
        out.append(float(np.median(slopes)) * (len(table) - 1) if len(slopes) else 0.0)
    return np.array(out)


def _jump(table: Reals, after: int) -> Reals:
    """(m,) difference of the medians after and before the jump; 0 for an output that one side does not have."""
    out = []
    for column in table.T:
        sides = [side[np.isfinite(side)] for side in (column[:after], column[after:])]
        out.append(float(np.median(sides[1]) - np.median(sides[0])) if all(map(len, sides)) else 0.0)
    return np.array(out)
