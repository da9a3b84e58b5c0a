"""Points at which a live model is made and compared: in the 95 % region, and in the ranges of the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from femtune.model.reduce.training import candidates
from femtune.steps.live.region import SEED

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.steps.live.region import AllowedRegion, Box

_CORNERS = 32
"""Corners of the ranges at most: all of them for up to five parameters, else some that are drawn."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points (n, k) of normalised parameters; other seeds give other ones.

    Parameters
    ----------
    region : None without a distribution of the parameters
    box : ends of the ranges
    """

    region: AllowedRegion | None
    box: Box

    def in_region(self, count: int, seed: int, certified: bool = False) -> Reals:
        """(count, k) samples of the region; none without one."""
        none = np.zeros((0, len(self.box[0])))
        return none if self.region is None else self.region.points(count, SEED + seed, certified)

    def in_ranges(self, count: int, seed: int) -> Reals:
        """(count, k) points of the ranges, a quarter of them on their edge."""
        return candidates(*self.box, count - count // 4, count // 4, SEED + 10 * seed)

    def corners(self) -> Reals:
        """(c, k) corners of the ranges: all of them for few parameters, else both ends and some that are drawn."""
        k, (lower, upper) = len(self.box[0]), self.box
        if 2**k <= _CORNERS:
            high = (np.arange(2**k)[:, None] >> np.arange(k)) & 1
        else:
            drawn = np.random.default_rng(SEED).integers(0, 2, (_CORNERS - 2, k))
            high = np.vstack([np.zeros(k, int), np.ones(k, int), drawn])
        return np.where(high == 1, upper, lower)
