"""Derivatives of modes by the method suited to the size of the model and to the request."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.model.derivatives.modes import SubspaceDerivative, exact_derivative
from femtune.model.derivatives.sensors import TOLERANCE, sensor_derivatives
from femtune.model.derivatives.streamed import derivatives_by_parameter
from femtune.model.eigen.solution import EigenSolution
from femtune.model.products import derivative_energies

LARGE = 10_000
"""Free DOFs from which on no matrix is assembled per parameter, and few sensors are solved for instead of all modes."""
_MOST_ROWS = 400
"""Rows that are solved for at most: each takes a solution and a vector per block."""
_PRIMAL_STEPS = 5
"""Solutions for a row, in blocks, that cost as much as one mode and parameter by iteration."""


def eigenvalue_derivatives(solution: EigenSolution) -> NDArray[np.float64]:
    """(m, k) ∂λ/∂x = φᵀ(K′ − λM′)φ of all modes by all free parameters, in one pass over the terms.

    Modes of one cluster of repeated eigenvalues have such derivatives along single directions only: see
    `subspace_derivative`.
    """
    stiffness = derivative_energies(solution.point, "stiffness", solution.shapes)
    mass = derivative_energies(solution.point, "mass", solution.shapes)
    return np.asarray((stiffness - mass * solution.eigenvalues).T)


def subspace_derivative(
    solution: EigenSolution,
    members: Sequence[int],
    rows: sp.csr_array | None = None,
    tolerance: float = TOLERANCE,
) -> SubspaceDerivative:
    """Derivatives of the subspace of some modes.

    Small models are solved exactly. For large ones with few rows all wanted modes are found together from solves for
    the rows, once for all clusters that are requested; see `sensor_derivatives`. The rest is exact again, one parameter
    at a time; where all free DOFs of many modes are wanted, take `derivatives_by_parameter`, which keeps none of them.

    Parameters
    ----------
    members : positions of the cluster's modes in the solution
    rows : C (rows, n_free), the combinations of DOFs that are wanted; None for all free DOFs
    tolerance : error relative to the largest entry of each mode's derivative at these rows; the result's `error` tells
        what is estimated

    Raises
    ------
    FemtuneError : ``derivative.not-converged``, ``model.memory``
    """
    if len(solution.shapes) < LARGE:
        return exact_derivative(solution, members, rows)
    if rows is not None and _is_dual(solution, members, rows):
        derivative = sensor_derivatives(solution, rows, tolerance).subspace(members)
        if derivative.error is not None and derivative.error <= tolerance:
            return derivative
    return _collected(solution, list(members), rows)


def _is_dual(solution: EigenSolution, members: Sequence[int], rows: sp.csr_array) -> bool:
    """Few rows beside the right-hand sides, and none of the modes at the end, whose neighbours are unknown."""
    sides = _PRIMAL_STEPS * solution.wanted * solution.point.n_parameters
    return rows.shape[0] <= min(_MOST_ROWS, sides) and max(members, default=0) < solution.wanted


def _collected(solution: EigenSolution, members: list[int], rows: sp.csr_array | None) -> SubspaceDerivative:
    """All parameters side by side."""
    parts = [one for (one,) in derivatives_by_parameter(solution, [members], rows)]
    if not parts:
        return exact_derivative(solution, members, rows)
    stiffness, mass = (np.concatenate(kind) for kind in zip(*((p.stiffness, p.mass) for p in parts)))
    outside = np.concatenate([p.outside for p in parts], axis=2)
    return SubspaceDerivative(parts[0].eigenvalues, stiffness, mass, outside, parts[0].shapes, 0.0)
