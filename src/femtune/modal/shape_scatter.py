"""Standard deviations of measured mode shapes, stated relative to the largest entry of each shape.

This is the meaning of `shape_sd` in [residuals], [validate] and [plan] of a study, of the scatter of simulated tests,
and of files of standard deviations. `sd` of a [[residual]] table of shapes refers to the scaled shape instead.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Reals


def largest_entries(shapes: NDArray) -> Reals:
    """(m,) largest modulus of the measured entries of each shape (n, m); 0 where nothing was measured."""
    return np.asarray(np.fmax.reduce(np.abs(shapes), axis=0, initial=0.0), dtype=float)


def entry_deviations(fraction: ArrayLike, shapes: NDArray) -> Reals:
    """Standard deviations (n, m) of the entries of shapes; NaN where an entry was not measured.

    Parameters
    ----------
    fraction : one for all, or (n, m), relative to the largest entry of each shape
    shapes : (n, m), NaN marks an entry that was not measured

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.modal import entry_deviations
    >>> entry_deviations(0.01, np.array([[2.0, np.nan], [-4.0, 1.0]]))
    array([[0.04,  nan],
           [0.04, 0.01]])
    """
    return np.where(np.isnan(shapes), np.nan, np.asarray(fraction, dtype=float) * largest_entries(shapes))
