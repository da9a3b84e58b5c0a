"""Names for arrays by what they hold; their shapes stand in the docstrings of the functions that take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]
