"""Forms of the FRF residual: differences, or the logarithm of the ratio, of model and measured functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]
FrfForm = Literal["linear", "log-magnitude", "log-complex"]
Pair = tuple[Reals, Reals]


def linear(model: Complexes, slope: Complexes, test: Complexes) -> Pair:
    """H − H_X with real above imaginary parts: values (2n,) and Jacobian (2n, p).

    Parameters
    ----------
    model, slope : H (n,) and ∂H/∂x (n, p)
    test : H_X (n,)
    """
    return _stacked(model - test, slope)


def log_complex(model: Complexes, slope: Complexes, test: Complexes) -> Pair:
    """Principal value of ln(H/H_X): n logarithms of the ratio of magnitudes, then n differences of phase in rad.

    The logarithm is taken of the ratio: the difference of two principal values jumps where one phase passes ±π.
    """
    return _stacked(np.log(model / test), slope / model[:, None])


def log_magnitude(model: Complexes, slope: Complexes, test: Complexes) -> Pair:
    """ln|H/H_X|: values (n,) and Jacobian (n, p)."""
    return np.log(model / test).real, (slope / model[:, None]).real


def _stacked(values: Complexes, slope: Complexes) -> Pair:
    return np.concatenate([values.real, values.imag]), np.concatenate([slope.real, slope.imag])


FORMS: Mapping[str, Callable[[Complexes, Complexes, Complexes], Pair]] = {
    "linear": linear,
    "log-magnitude": log_magnitude,
    "log-complex": log_complex,
}
