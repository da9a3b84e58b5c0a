"""Types of arrays by their elements; shapes are given in the docstrings of the functions that use them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]
