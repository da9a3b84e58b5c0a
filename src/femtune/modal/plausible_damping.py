"""Damping ratios that no structure has: negative ones, and percentages that were written as fractions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

LARGEST_RATIO = 0.2
"""Damping ratio from which a mode is doubtful. Steel and aluminium structures have 0.001 to 0.02, bolted and concrete
ones up to 0.07; a structure on strong dampers reaches about 0.15."""
LARGEST_MEDIAN = 0.1
"""Median of the damping ratios of a structure from which all are taken for percentages: 0.1 to 0.5 % are common
percentages, and no ordinary structure has half of its modes above 10 %."""
_FEWEST = 3
"""Number of values from which their median is judged."""


def doubtful_ratios(ratios: ArrayLike) -> NDArray[np.int64]:
    """Positions of damping ratios that are negative or too large; NaN and 0 mean "not known" and are never doubtful.

    Examples
    --------
    >>> doubtful_ratios([0.01, 1.5, -0.02, 0.0]).tolist()
    [1, 2]
    >>> doubtful_ratios([0.11, 0.15, 0.3]).tolist()
    [0, 1, 2]
    """
    values = np.atleast_1d(np.asarray(ratios, float))
    known = np.isfinite(values) & (values != 0.0)
    if known.sum() >= _FEWEST and np.median(values[known]) >= LARGEST_MEDIAN:
        return np.flatnonzero(known)
    return np.flatnonzero(known & ((values < 0.0) | (values >= LARGEST_RATIO)))
