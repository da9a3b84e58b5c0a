"""Eigenvector derivatives by Nelson's method (1976) with matrices differentiated by complex step: the exact check.

Nothing is shared with femtune's own derivatives but the assembly of K and M and the factorisation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cases import sensor_rows
from femtune.model import EigenSolution, SubspaceDerivative
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.factorise import factorise

Reals = NDArray[np.float64]

_STEP, _NOTHING = 1e-30, 1e-9
_CHECKED = (0.3, 1.0)
"""Which of the single modes are checked: as fractions of their number."""


def derivative_error(
    solution: EigenSolution, found: list[SubspaceDerivative], groups: list[list[int]]
) -> dict[str, float]:
    """Largest errors of ∂λ/∂x and of ∂φ/∂x at the sensors over the modes checked.

    Each is relative to the largest of its mode's derivatives by all parameters; `single_shapes` are relative to the
    derivative by the same parameter, small as it may be.
    """
    single = [i for i, group in enumerate(groups) if len(group) == 1]
    errors = [
        _errors(solution, found[i], groups[i][0]) for i in (single[round(f * (len(single) - 1))] for f in _CHECKED)
    ]
    return {name: max(error[name] for error in errors) for name in errors[0]}


def _errors(solution: EigenSolution, found: SubspaceDerivative, mode: int) -> dict[str, float]:
    of_value, of_shape = nelson(solution, mode)
    seen = sensor_rows(solution.point.configured) @ of_shape
    length = np.linalg.norm(seen, axis=0)
    off = np.linalg.norm(found.shape_gradient - seen, axis=0)
    some = length > _NOTHING * length.max()
    value = np.abs(found.eigenvalue_gradient - of_value).max() / np.abs(of_value).max()
    return {
        "eigenvalues": float(value),
        "shapes": float(off.max() / length.max()),
        "single_shapes": float((off[some] / length[some]).max()),
    }


def nelson(solution: EigenSolution, mode: int) -> tuple[Reals, Reals]:
    """(k,) ∂λ/∂x and (n, k) ∂φ/∂x of a single mode with φᵀMφ = 1."""
    K, M = solution.point.symmetric_stiffness, solution.point.symmetric_mass
    eigenvalue, phi = float(solution.eigenvalues[mode]), solution.shapes[:, mode]
    stiffness, mass = _products(solution, phi)
    slopes = phi @ (stiffness - eigenvalue * mass)
    forces = -(stiffness - eigenvalue * mass) + np.outer(M @ phi, slopes)
    at = int(np.argmax(np.abs(phi)))
    forces[at] = 0.0
    shifted = _without(K.plus(-eigenvalue, M), at)
    v = factorise(shifted).solve(np.asfortranarray(forces))
    factor = -(phi @ (M @ v)) - 0.5 * (phi @ mass)
    return slopes, v + phi[:, None] * factor


def _products(solution: EigenSolution, phi: Reals) -> tuple[Reals, Reals]:
    """(n, k) K′φ and M′φ."""
    model, x = solution.point.configured, solution.point.x
    stiffness, mass = [], []
    for i in range(len(x)):
        point = model.at(x + 1j * _STEP * (np.arange(len(x)) == i))
        stiffness.append(_imaginary(point.symmetric_stiffness) @ phi / _STEP)
        mass.append(_imaginary(point.symmetric_mass) @ phi / _STEP)
        del point
    return np.stack(stiffness, axis=1), np.stack(mass, axis=1)


def _imaginary(matrix: SymmetricMatrix) -> SymmetricMatrix:
    return SymmetricMatrix(np.ascontiguousarray(matrix.data.imag), matrix.indices, matrix.indptr)


def _without(matrix: SymmetricMatrix, at: int) -> SymmetricMatrix:
    """The matrix with a row and column of zeros, but for its diagonal."""
    data = matrix.data.copy()
    start, end = matrix.indptr[at], matrix.indptr[at + 1]
    diagonal = data[start]
    data[matrix.indices == at] = 0.0
    data[start:end] = 0.0
    data[start] = abs(diagonal)
    return SymmetricMatrix(data, matrix.indices, matrix.indptr)
