"""Frequency residual (f − f_e)/(σ f_e), or the same of eigenvalues (handbook chapter, eigenvalue residual)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


def frequency_residual(
    eigenvalue: float, gradient: Reals, test_hz: float, sd: float, form: str = "frequency"
) -> tuple[Reals, Reals]:
    """Residual (1,) and Jacobian (1, k).

    Parameters
    ----------
    eigenvalue, gradient : λ in rad²/s² and ∂λ/∂x (k,)
    test_hz : test frequency
    sd : relative standard deviation σ of the frequency, or of the eigenvalue
    form : "frequency" or "eigenvalue"
    """
    ratio = eigenvalue / (2.0 * np.pi * test_hz) ** 2
    slope = gradient / (2.0 * np.pi * test_hz) ** 2
    if form == "frequency":
        root = np.sqrt(max(ratio, 0.0))
        ratio, slope = root, slope / (2.0 * max(root, 1e-12))
    return np.array([(ratio - 1.0) / sd]), slope[None, :] / sd
