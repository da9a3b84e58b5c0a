"""The minimum of a sum of squares on a surrogate: a global search, improved by bounded least squares.

The surrogate has exact gradients, so that the least squares converge from wherever the global search ends. Several
seeds tell whether the minimum is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from femtune.arrays import Reals
from femtune.global_search.methods import GlobalMinimum, SearchRules, global_minimum
from femtune.surrogates import SumOfSquares, Surrogate

_SAME = 1e-3
"""Distance, in edges of the box, below which two minima are the same."""


@dataclass(frozen=True, eq=False)
class SurrogateMinimum:
    """The minima that several seeds found.

    Parameters
    ----------
    x : (n,) the best
    value : objective there, ½ rᵀr
    searches : the global search of each seed
    ends : (s, n) where the least squares from each of them ended
    values : (s,) objective there
    at_bound : (n,) −1 and 1 where the best is on the lower or the upper bound, otherwise 0
    """

    x: Reals
    value: float
    searches: tuple[GlobalMinimum, ...]
    ends: Reals
    values: Reals
    at_bound: Reals
    edges: Reals

    @property
    def same(self) -> int:
        """Number of seeds that ended at the best minimum."""
        return int(np.sum(np.abs((self.ends - self.x) / self.edges).max(axis=1) <= _SAME))


def surrogate_minimum(
    surrogate: Surrogate,
    objective: SumOfSquares,
    box: tuple[Reals, Reals],
    rules: SearchRules | None = None,
    seeds: Sequence[int] = (0, 1, 2),
) -> SurrogateMinimum:
    """The least sum of squares within a box, which may be a part of that of the surrogate.

    Parameters whose bounds coincide keep their value.
    """
    rules = rules or SearchRules()
    lower, upper = (np.asarray(edge, dtype=float) for edge in box)
    free = upper > lower

    def whole(part: Reals) -> Reals:
        points = np.tile(lower, (len(np.atleast_2d(part)), 1))
        points[:, free] = part
        return points

    def residuals(part: Reals) -> Reals:
        return np.asarray((surrogate.predict(whole(part))[0] - objective.target) / objective.sd)

    def slopes(part: Reals) -> Reals:
        return np.asarray(surrogate.gradient(whole(part))[0][:, free] / objective.sd[:, None])

    bounds = (lower[free], upper[free])
    searches, ends, values = [], [], []
    for seed in seeds:
        minimum = global_minimum(lambda p: objective(surrogate.predict(whole(p))), *bounds, replace(rules, seed=seed))
        width = bounds[1] - bounds[0]
        start = np.clip(minimum.x, bounds[0] + 1e-6 * width, bounds[1] - 1e-6 * width)
        fine = least_squares(
            residuals, start, slopes, bounds, x_scale=width, xtol=1e-12, ftol=1e-14, gtol=1e-14, max_nfev=500
        )
        end, value = (fine.x, float(fine.cost)) if fine.cost <= minimum.value else (minimum.x, minimum.value)
        searches.append(minimum)
        ends.append(whole(end)[0])
        values.append(value)
    best = int(np.argmin(values))
    x = ends[best]
    edges = np.where(free, upper - lower, 1.0)
    side = np.where(x - lower <= 1e-6 * edges, -1, 0) + np.where(upper - x <= 1e-6 * edges, 1, 0)
    return SurrogateMinimum(
        x, values[best], tuple(searches), np.array(ends), np.array(values), np.where(free, side, 0), edges
    )
