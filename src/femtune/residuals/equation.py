"""Equation errors Aψ − f of a shape that was measured in part: what was not measured is chosen for the least error.

That is variable projection (Golub and Pereyra 1973) of the unmeasured entries: the minimum of |Aψ − f|² under Sψ = m is
one symmetric linear system, regular even where A itself is singular (at an eigenvalue), and its derivative another with
the same matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from femtune.errors import FemtuneError

Reals = NDArray[np.float64]

_ACCURATE = 1e-6


@dataclass(frozen=True, eq=False)
class LeastEquationError:
    """The least equation error.

    Parameters
    ----------
    error, gradient : r = Aψ − f (n,) and ∂r/∂x (n, k)
    shape : ψ (n,), equal to what was measured at the sensors
    """

    error: Reals
    gradient: Reals
    shape: Reals


def equation_error(
    matrix: sp.csr_array,
    derivatives: Sequence[sp.csr_array],
    sensors: sp.csr_array,
    measured: Reals,
    force: Reals | None = None,
) -> LeastEquationError:
    """The least |Aψ − f| of all ψ with Sψ = m.

    Parameters
    ----------
    matrix, derivatives : A (n, n) symmetric and ∂A/∂x of k parameters
    sensors, measured : S (s, n) and m (s,)
    force : f (n,), none where it is zero

    Raises
    ------
    FemtuneError : ``residual.sensors-dependent`` where the measured combinations of DOFs depend on one another, or
        leave a motion without any error
    """
    n, s = matrix.shape[0], sensors.shape[0]
    f = np.zeros(n) if force is None else force
    size = float(np.abs(matrix.data).max(initial=0.0)) or 1.0
    saddle = _saddle(matrix, sensors, size)
    factor = _factorised(saddle)
    first = _solved(saddle, factor, np.concatenate([f, np.zeros(n), size * measured])[:, None])[:, 0]
    scaled, shape = first[:n], first[n : 2 * n]
    loads = [np.concatenate([-(d @ shape), -(d @ scaled), np.zeros(s)]) for d in derivatives]
    slopes = _solved(saddle, factor, np.stack(loads, axis=1))[:n] if loads else np.zeros((n, 0))
    return LeastEquationError(size * scaled, size * slopes, shape)


def _saddle(matrix: sp.csr_array, sensors: sp.csr_array, size: float) -> sp.csc_array:
    """For (r/β, ψ, multipliers) with β the size of A, so that all blocks have one size."""
    n = matrix.shape[0]
    observe = size * sp.csr_array(sensors)
    return sp.csc_array(
        sp.block_array([[-size * sp.eye_array(n), matrix, None], [matrix, None, observe.T], [None, observe, None]])
    )


def _factorised(saddle: sp.csc_array) -> SuperLU:
    try:
        return splu(saddle)
    except RuntimeError as error:
        raise _dependent() from error


def _solved(saddle: sp.csc_array, factor: SuperLU, loads: Reals) -> Reals:
    """With one step of refinement; what stays wrong then is no solution."""
    found = factor.solve(loads)
    found = found + factor.solve(loads - saddle @ found)
    left = np.linalg.norm(loads - saddle @ found, axis=0)
    if not (left <= _ACCURATE * np.linalg.norm(loads, axis=0)).all():
        raise _dependent()
    return np.asarray(found)


def _dependent() -> FemtuneError:
    return FemtuneError(
        "residual.sensors-dependent",
        "the equation error has no single least value: measured combinations of DOFs depend on one another, or leave "
        "a motion that needs no force",
        hint="take sensors out that repeat others, or measure more of the structure",
    )
