"""The front of several objectives: points of which none is better than another in all of them (NSGA-II).

The operators are those of the genetic algorithm. Children and parents compete: the next generation are the best ranks,
and of the last rank that has not enough room, points with the most distant neighbours.

Source: Deb, Pratap, Agarwal and Meyarivan 2002 (NSGA-II).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Flags, Integers, Reals
from femtune.global_search.methods import Objective, SearchRules, crossed, mutated, tournament


@dataclass(frozen=True, eq=False)
class Front:
    """Points that no other point of the search is better than in all objectives.

    Parameters
    ----------
    x : (k, n) in the order of the first objective
    values : (k, m) objectives
    evaluations : number of evaluations
    """

    x: Reals
    values: Reals
    evaluations: int

    def spread(self, count: int) -> Integers:
        """Positions of at most so many points at even distances along the front, with its ends.

        On a surface of three and more objectives each next point is the one that is farthest from those before.
        """
        if count >= len(self.x):
            return np.arange(len(self.x))
        edges = np.ptp(self.values, axis=0)
        if self.values.shape[1] > 2:
            return self._apart(count, self.values / np.where(edges > 0.0, edges, 1.0))
        steps = np.diff(self.values, axis=0) / np.where(edges > 0.0, edges, 1.0)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
        wanted = np.linspace(0.0, along[-1], count)
        return np.unique(np.abs(along[:, None] - wanted).argmin(axis=0))

    def _apart(self, count: int, places: Reals) -> Integers:
        chosen = list(dict.fromkeys(places.argmin(axis=0).tolist()))[:count]
        while len(chosen) < count:
            distance = np.linalg.norm(places[:, None] - places[chosen], axis=2).min(axis=1)
            chosen.append(int(distance.argmax()))
        return np.array(sorted(set(chosen)))


def front_of(objectives: Objective, lower: Reals, upper: Reals, rules: SearchRules | None = None) -> Front:
    """The front of objectives within bounds, all of which should be small.

    Parameters
    ----------
    objectives : (k, n) points → (k, m); a point that cannot be computed has a value that is not finite
    rules : population, generations, crossover, mutation and seed; `method` and `tolerance` are not used

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.global_search import SearchRules, front_of
    >>> both = lambda x: np.stack([x[:, 0] ** 2, (x[:, 0] - 1.0) ** 2], axis=1)
    >>> found = front_of(both, np.array([-5.0]), np.array([5.0]), SearchRules(generations=60))
    >>> bool(np.abs(np.sqrt(found.values).sum(axis=1) - 1.0).max() < 0.01)
    True
    """
    rules = rules or SearchRules()
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    rng = np.random.default_rng(rules.seed)
    size = 2 * max(2, round(rules.population / 2))

    def computed(unit: Reals) -> Reals:
        values = np.asarray(objectives(lower + unit * (upper - lower)), dtype=float)
        return np.where(np.isfinite(values).all(axis=1)[:, None], values, np.inf)

    points = rng.random((size, len(lower)))
    values = computed(points)
    for _ in range(rules.generations):
        place = np.empty(size)
        place[_order(values)] = np.arange(size)
        parents = points[tournament(place, size, rng)]
        children = mutated(crossed(parents, rules.crossover, rng), rules.mutation, rng)
        points, values = np.vstack([points, children]), np.vstack([values, computed(children)])
        kept = _order(values)[:size]
        points, values = points[kept], values[kept]
    best = np.flatnonzero((ranks(values) == 0) & np.isfinite(values).all(axis=1))
    # in the order of the first objective, without copies
    best = best[np.unique(values[best], axis=0, return_index=True)[1]]
    return Front(lower + points[best] * (upper - lower), values[best], size * (rules.generations + 1))


def ranks(values: Reals) -> Integers:
    """(k,) 0 for points that no other is better than; 1 for those that only points of rank 0 are better than …"""
    worse = _dominates(values)
    rank_of = np.full(len(values), -1)
    left: Flags = np.ones(len(values), bool)
    rank = 0
    while left.any():
        best = left & ~worse[left].any(axis=0)
        rank_of[best] = rank
        left &= ~best
        rank += 1
    return rank_of


def _dominates(values: Reals) -> Flags:
    """(k, k) True where the first point is not worse in any objective and better in one."""
    one, other = values[:, None], values[None]
    return np.asarray((one <= other).all(axis=2) & (one < other).any(axis=2))


def _order(values: Reals) -> Integers:
    """Positions of the points, the best first: by rank, then by the distance of the neighbours of the same rank."""
    rank = ranks(values)
    crowding = np.zeros(len(values))
    for r in range(int(rank.max()) + 1):
        mine = np.flatnonzero(rank == r)
        crowding[mine] = _distances(values[mine])
    return np.lexsort((-crowding, rank))


def _distances(values: Reals) -> Reals:
    """(k,) sum over the objectives of the distance between the neighbours; infinite for the ends."""
    out = np.zeros(len(values))
    if not np.isfinite(values).all():
        return out
    for column in values.T:
        order = np.argsort(column, kind="stable")
        near = column[order]
        out[order[[0, -1]]] = np.inf
        if near[-1] > near[0]:
            out[order[1:-1]] += (near[2:] - near[:-2]) / (near[-1] - near[0])
    return out
