"""The phase of a complex shape: what turns it as near to the real axis as it can be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def turn_to_real_axis(shapes: NDArray) -> NDArray[np.complex128]:
    """Factors of modulus one, one a shape, that make the imaginary part of each shape smallest.

    The phase is half the argument of Σ φ², the least-squares line through the entries.

    Parameters
    ----------
    shapes : (n,) or (n, m); NaN entries count nothing
    """
    return np.asarray(np.exp(-0.5j * np.angle(np.nansum(shapes**2, axis=0))), dtype=complex)
