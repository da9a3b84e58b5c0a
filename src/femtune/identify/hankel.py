"""Block Hankel matrices of correlation functions, their scatter, and the sizes that fit a record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


def block_hankel(functions: Reals, rows: int, columns: int, first: int = 1) -> Reals:
    """(rows·s, columns·r) with block (i, j) = functions[:, :, first + i + j].

    Parameters
    ----------
    functions : (s, r, lags + 1) correlation functions or free decays
    rows, columns : blocks; first + rows + columns − 2 may not exceed the lags
    """
    s, r, _ = functions.shape
    window = np.lib.stride_tricks.sliding_window_view(functions[:, :, first : first + rows + columns - 1], columns, 2)
    return np.asarray(window.transpose(2, 0, 3, 1).reshape(rows * s, columns * r))
