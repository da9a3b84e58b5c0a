"""The 95 % region of an update as the page has it, and models that the data allow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.steps.live.record import LiveDraws, LiveFactor, LiveRegion

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.updating import UpdateResult

    Box = tuple[Reals, Reals]
    """Lower and upper ends (k,) of the ranges of the normalised parameters."""

SEED = 36
"""Of the points, so that a study gives the same page again."""
_NARROW = 0.25
"""Part of the width of the samples by which narrower ranges go beyond them."""
_LEVEL = 0.95
"""Probability of the region."""
_SHOWN = 20
"""Models that the data allow, of those that a page shows."""
_DRAWN_LINEAR = 300
"""Samples of the linearised distribution that a page weighs."""
_UNDETERMINED = 100.0
"""Widths of the samples that a combination of parameters is taken to have where the data leave it undetermined."""
_LEAST_WIDTH = 1e-9
"""Width of samples that do not spread, so that it can be divided by."""


@dataclass(frozen=True, eq=False)
class AllowedRegion:
    """Points with |A (x − x̂) + b|² ≤ limit within the bounds, and samples of the distribution that are in it."""

    at: Reals
    moving: NDArray[np.bool_]
    rows: Reals
    offset: Reals
    limit: float
    inside: Reals
    size: Reals

    @classmethod
    def of(cls, result: UpdateResult) -> AllowedRegion | None:
        posterior = result.covariance.posterior
        if posterior is None or not len(posterior.samples):
            return None
        x = posterior.samples
        d = (x - posterior.at)[:, posterior.moving]
        q = np.sum((d @ posterior.rows.T + posterior.offset) ** 2, axis=1)
        limit = float(np.quantile(q, _LEVEL))
        inside = q <= limit
        return cls(posterior.at, posterior.moving, posterior.rows, posterior.offset, limit, x[inside], q[inside])

    def points(self, count: int, seed: int, certified: bool = False) -> Reals:
        """(count, k) samples: half from the outer half of the region; those to certify are none to train with."""
        random = np.random.default_rng(seed)
        # neighbours in the sequence of the samples are no random halves of it
        half = np.random.default_rng(SEED).permutation(len(self.inside))[int(certified) :: 2]
        every, size = self.inside[half], self.size[half]
        outer = np.flatnonzero(size >= np.median(size))
        some = random.choice(outer, count // 2, replace=len(outer) < count)
        more = random.choice(len(every), count - count // 2, replace=len(every) < count)
        return every[np.concatenate([some, more])]

    def box(self, result: UpdateResult, sampled: Sampled | None) -> Box:
        """Ranges about the region, the samples of a posterior distribution and the updated point, within the bounds."""
        x = np.vstack([self.inside, np.asarray(result.x)[None], *([] if sampled is None else [sampled.x])])
        low, high, (lower, upper) = x.min(axis=0), x.max(axis=0), result.parameters.bounds
        more = np.maximum(_NARROW * (high - low), 1e-3 * (upper - lower))
        return np.maximum(low - more, lower), np.minimum(high + more, upper)

    def record(self, arrays: dict[str, NDArray]) -> LiveRegion:
        # combinations that the data leave undetermined are as wide as the samples, many times over
        width = _UNDETERMINED * np.maximum(np.ptp(self.inside[:, self.moving], axis=0), _LEAST_WIDTH)
        both = np.vstack([self.rows, np.diag(1.0 / width)])
        right = np.concatenate([self.offset, np.zeros(len(width))])
        change = -np.linalg.lstsq(both, right, rcond=None)[0]
        least = float(np.sum((self.rows @ change + self.offset) ** 2))
        at = self.at[self.moving]
        stored = {
            "at": at, "rows": self.rows, "offset": self.offset, "centre": at + change,
            "precision": both.T @ both,
        }  # fmt: skip
        arrays |= {f"live/region/{name}": a for name, a in stored.items()}
        keys = {f"{name}_key": f"live/region/{name}" for name in stored}
        return LiveRegion(
            moving=tuple(np.flatnonzero(self.moving).tolist()), limit=self.limit,
            radius_square=max(self.limit - least, 0.0), **keys,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Sampled:
    """Samples of a posterior distribution: `x` (n, k), normalised, and their `weights` (n,)."""

    x: Reals
    weights: Reals


def allowed_models(
    result: UpdateResult, region: AllowedRegion | None, sampled: Sampled | None, box: Box, others: bool,
    arrays: dict[str, NDArray],
) -> LiveDraws | None:  # fmt: skip
    """From the posterior where there is one, else from the linearised distribution."""
    random = np.random.default_rng(SEED)
    if sampled is not None:
        chosen = random.choice(len(sampled.x), _SHOWN, p=sampled.weights / sampled.weights.sum())
        arrays["live/draws"] = sampled.x[chosen]
        return LiveDraws(source="posterior", x_key="live/draws")
    posterior = result.covariance.posterior
    if region is None or posterior is None:
        return None
    x = posterior.samples
    x = x[random.choice(len(x), min(_DRAWN_LINEAR, len(x)), replace=False)]
    # samples beyond narrowed ranges are beyond the 95 % limit too
    x = x[((x >= box[0]) & (x <= box[1])).all(axis=1)]
    d = (x - posterior.at)[:, posterior.moving]
    arrays["live/draws"] = x
    arrays["live/draws_linear"] = np.sum((d @ posterior.rows.T + posterior.offset) ** 2, axis=1)
    reason = "some residuals are not computed again" if others else ""
    if len(result.side.matrix) and result.smallest_change is None:
        reason = "the update has a side constraint beside the residuals"
    return LiveDraws(
        source="linear", x_key="live/draws", linear_key="live/draws_linear",
        degrees=posterior.degrees if np.isfinite(posterior.degrees) else None,
        factors=tuple(LiveFactor(kind=k, factor=f) for k, f in result.covariance.factors.items()), reason=reason,
    )  # fmt: skip
