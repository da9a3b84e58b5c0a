"""Are the modes right? Each way's own result against the equation; a wrong one does not count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers.factorise import factorise

Reals = NDArray[np.float64]

ENERGY, ORTHONORMAL, FREQUENCY, DERIVATIVE = 1e-8, 1e-10, 1e-7, 1e-4
_RIGID = 1e-3
_BLOCK = 10


@dataclass(frozen=True)
class Checked:
    """Largest over the modes.

    Parameters
    ----------
    energy : √(rᵀ(K − σM)⁻¹r/(λ − σ)) with r = Kφ − λMφ
    force : ‖D⁻¹r‖/(‖D⁻¹Kφ‖ + λ‖D⁻¹Mφ‖) with D² the diagonal of K, of elastic modes
    orthonormal : |φᵢᵀMφⱼ − δᵢⱼ|
    """

    energy: float
    force: float
    orthonormal: float

    def wrong(self) -> str:
        """What does not hold, or nothing."""
        if not self.energy <= ENERGY:
            return f"energy of a residual is {self.energy:.1e}"
        if not self.orthonormal <= ORTHONORMAL:
            return f"not mass-orthonormal: {self.orthonormal:.1e}"
        return ""


def check_modes(
    matrices: tuple[SymmetricMatrix, SymmetricMatrix], shift: float, values: Reals, shapes: Reals
) -> Checked:
    """Residuals and orthonormality."""
    K, M = matrices
    inverse = factorise(K.plus(-shift, M))
    scale = 1.0 / np.sqrt(K.diagonal())[:, None]
    energy, force, heavy = np.zeros(len(values)), np.zeros(len(values)), np.empty(shapes.shape)
    for start in range(0, len(values), _BLOCK):
        part = slice(start, start + _BLOCK)
        elastic, heavy[:, part] = K @ shapes[:, part], M @ shapes[:, part]
        inertial = heavy[:, part] * values[part]
        r = elastic - inertial
        energy[part] = np.sqrt(np.abs(np.einsum("ij,ij->j", r, inverse.solve(r))) / (values[part] - shift))
        size = np.linalg.norm(scale * elastic, axis=0) + np.linalg.norm(scale * inertial, axis=0)
        force[part] = np.linalg.norm(scale * r, axis=0) / size
    own = np.abs(shapes.T @ heavy - np.eye(len(values))).max()
    elastic_modes = values > _RIGID * abs(shift)
    return Checked(float(energy.max()), float(force[elastic_modes].max(initial=0.0)), float(own))


def frequency_difference(found: Reals, wanted: Reals) -> float:
    """Largest relative difference, as half of that of the squares.

    Squares of rigid-body frequencies are rounding; they are measured by that of the first elastic one.
    """
    squares, right = np.sort(np.square(found)), np.sort(np.square(wanted))
    if len(squares) != len(right):
        return float("inf")
    elastic = right[right > _RIGID**2 * right[-1]]
    return float(0.5 * np.max(np.abs(squares - right) / np.maximum(right, elastic[0])))


def hertz(values: Reals) -> Reals:
    """Frequencies of eigenvalues."""
    return np.asarray(np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi))
