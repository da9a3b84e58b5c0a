"""Listed frequencies beside found ones: the digits of a list, and modes that only one of both has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

# what rounding may excuse: a list of fewer digits than this shows nothing
_COARSEST = 0.01


def rounding_hz(listed_hz: Sequence[float]) -> float:
    """Half a unit of the last decimal place that some number of the list has: 0.005 of 7.91 and 12.3."""
    places = [Decimal(repr(float(f))).normalize().as_tuple().exponent for f in listed_hz]
    return 0.5 * 10.0 ** min((p for p in places if isinstance(p, int)), default=0)


def excused(listed_hz: Reals, rounding: float) -> Reals:
    """Difference in Hz that the digits of the list explain."""
    return np.minimum(rounding * (1.0 + 1e-9), _COARSEST * listed_hz)


@dataclass(frozen=True)
class Unpaired:
    """Positions of modes that only the matrices, or only the list, have, and the number of those that both have."""

    found: tuple[int, ...]
    listed: tuple[int, ...]
    paired: int

    @property
    def telling(self) -> bool:
        """Most modes are the same, and the others are more than the lowest ones of one side (missing supports)."""
        lowest = {(self.found, ()), ((), self.listed)}
        shifted = (self.found, self.listed) in lowest and max(self.found + self.listed) < len(self.found + self.listed)
        few = len(self.found) + len(self.listed) <= self.paired
        return self.paired > 1 and few and bool(self.found or self.listed) and not shifted


def unpaired(found: Reals, listed: Reals, allowed: Reals) -> Unpaired:
    """Walk up both ascending lists; found modes above the last listed one are no matter.

    Parameters
    ----------
    allowed : (listed,) difference in Hz of a pair
    """
    only_found: list[int] = []
    only_listed: list[int] = []
    i = j = 0
    while j < len(listed):
        if i < len(found) and abs(found[i] - listed[j]) <= allowed[j]:
            i, j = i + 1, j + 1
        elif i < len(found) and found[i] < listed[j]:
            only_found.append(i)
            i += 1
        else:
            only_listed.append(j)
            j += 1
    return Unpaired(tuple(only_found), tuple(only_listed), len(listed) - len(only_listed))
