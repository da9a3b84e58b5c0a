"""Where the next runs should be: where the surrogate is least certain or wrong, or where an objective may be better.

Points are chosen among those of a Sobol sequence. After each choice the surrogate is given its own prediction there,
with unchanged lengths (Ginsbourger, Le Riche and Carraro 2010), so that several runs can be made side by side.

Sources: Jones, Schonlau and Welch 1998 (expected improvement); Uhrenholt and Jensen 2019 (of a sum of squares); Liu,
Cai and Ong 2017 (expected prediction error).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import ndtri

from femtune.arrays import Reals
from femtune.surrogates.surrogate import Surrogate

_CANDIDATES = 10
"""log₂ of their number."""
_DRAWS = 7
"""log₂ of the number of draws of the responses at each candidate."""


@dataclass(frozen=True, eq=False)
class SumOfSquares:
    """½ Σ ((y − target)/sd)² over the responses.

    Parameters
    ----------
    target, sd : (m,)
    """

    target: Reals
    sd: Reals

    def __call__(self, y: Reals) -> Reals:
        """(…,) of responses (…, m)."""
        return np.asarray(0.5 * np.sum(((y - self.target) / self.sd) ** 2, axis=-1))


def with_run(surrogate: Surrogate, x: Reals, y: Reals) -> Surrogate:
    """The surrogate with one more run (n,), (m,), at unchanged hyperparameters."""
    return surrogate.with_runs(np.vstack([surrogate.x, x]), np.vstack([surrogate.y, y]))


def where_wrong(surrogate: Surrogate, count: int, seed: int = 0) -> Reals:
    """(count, n) points at which the expected squared error is the largest, in units of the spread of each response.

    The expected squared error is the variance of the surrogate, and the square of the error with which it predicts the
    nearest run from all others. The variance alone depends on the places of the runs only; the second part leads to
    where the responses vary more than elsewhere. A point that was chosen has no error yet.
    """
    error = np.max(((surrogate.left_out - surrogate.y) / surrogate.scale) ** 2, axis=1)
    size = surrogate.upper - surrogate.lower

    def worth(current: Surrogate, points: Reals) -> Reals:
        away = cdist(points / size, current.x / size, "sqeuclidean")
        known = np.concatenate([error, np.zeros(len(current.x) - len(error))])
        variance = np.max((current.predict_sd(points) / current.scale) ** 2, axis=1)
        return np.asarray(variance + known[away.argmin(axis=1)])

    return _chosen(surrogate, count, seed, worth)


def where_better(surrogate: Surrogate, objective: SumOfSquares, count: int, seed: int = 0) -> Reals:
    """(count, n) points at which a sum of squares is expected to improve the most on the best run.

    The expectation is a mean over draws of the responses, which are normal and independent of each other.
    """
    from scipy.stats import qmc  # noqa: PLC0415  half a second that other criteria do not need

    draws = ndtri(qmc.Sobol(len(surrogate.fits), rng=np.random.default_rng(seed)).random_base2(_DRAWS))

    def worth(current: Surrogate, points: Reals) -> Reals:
        best = np.min(objective(current.y))
        middle, sd = current.predict(points), current.predict_sd(points)
        away = sd * draws[:, None]
        y = middle * np.exp(away) if current.rules.logarithms else middle + away
        return np.asarray(np.mean(np.maximum(best - objective(y), 0.0), axis=0))

    return _chosen(surrogate, count, seed, worth)


def _chosen(surrogate: Surrogate, count: int, seed: int, worth: Callable[[Surrogate, Reals], Reals]) -> Reals:
    from scipy.stats import qmc  # noqa: PLC0415  half a second that only new points need

    unit = qmc.Sobol(surrogate.x.shape[1], rng=np.random.default_rng(seed)).random_base2(_CANDIDATES)
    points = surrogate.lower + unit * (surrogate.upper - surrogate.lower)
    chosen = []
    for _ in range(count):
        best = points[int(np.argmax(worth(surrogate, points)))]
        chosen.append(best)
        surrogate = with_run(surrogate, best, surrogate.predict(best)[0])
    return np.array(chosen)
