"""CQUAD4 and CTRIA3 of the commercial program, read off its element matrices of a unit square and its half.

The stiffness of each has three parts. Constant curvature has its exact energy. The square's rotations that alternate
from corner to corner bend it by curvature that varies linearly across, and meet uniaxial stress: E t³/12 times a third.
What is left of the matrix is a quadratic form of the side shears g, the integrals of the transverse shear along the
sides; its inverse, the flexibility, is exactly `SHEAR` / S + `BENDING` / D with S = κ G t and D = E t³ / 12 (1 − ν²),
at all three thicknesses that the file has. The parts of 1/D are MacNeal's residual bending flexibility (Computers and
Structures 8, 1978, 175-183; on the square 1/12 for the mean shear of two opposite sides, as for a beam of length one).

Drilling is a spring at each corner, 1e-6 K6ROT G t, between its rotation and that of the linear or bilinear
displacements at the corner; the square and its half have the same spring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

ROOT = np.sqrt(2.0)

_OPPOSITE = np.kron(np.array([[0.0, 1.0], [1.0, 0.0]]), np.eye(2))
_LEGS = np.diag([1.0, 1.0, 0.0])
_SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
_LONG = np.diag([0.0, 0.0, 1.0])
_MIXED = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]])

SHEAR = {
    4: 4.0 * np.eye(4) + 2.0 * _OPPOSITE,
    3: 4.0 * _LEGS + 2.0 * _SWAP + 8.0 * _LONG + 2.0 * (ROOT - 1.0) * _MIXED,
}
"""Flexibility of the side shears for 1/S, by the number of corners."""

BENDING = {
    4: (1.0 / 12.0 + 1.0 / 160.0) * np.eye(4) - (1.0 / 12.0 - 1.0 / 160.0) * _OPPOSITE,
    3: _LEGS / 3.0 + _SWAP / 4.0 + 5.0 / 6.0 * _LONG - (ROOT - 1.0) ** 2 / 12.0 * _MIXED,
}
"""Flexibility of the side shears for 1/D, by the number of corners."""


@dataclass(frozen=True)
class Plate:
    """Moduli and thickness of an isotropic plate; `kappa` is TS of PSHELL."""

    young: float
    poisson: float
    shear: float
    thickness: float
    kappa: float = 5.0 / 6.0

    @property
    def bending(self) -> float:
        """D = E t³ / 12 (1 − ν²)."""
        return self.young * self.thickness**3 / 12.0 / (1.0 - self.poisson**2)

    @property
    def transverse(self) -> float:
        """S = κ G t."""
        return self.kappa * self.shear * self.thickness


def bending_stiffness(plate: Plate, corners: Reals) -> Reals:
    """(3n, 3n) on (w, θx, θy) of the corners of a unit square or its half, from any corner and in any position."""
    return constant_curvature(plate, corners) + alternating_rotations(plate, corners) + _side_shears(plate, corners)


def constant_curvature(plate: Plate, corners: Reals) -> Reals:
    """The mean curvature's energy."""
    slope = mean_gradient(corners)
    rows = np.zeros((3, 3 * len(corners)))
    rows[0, 2::3], rows[1, 1::3] = slope[0], -slope[1]
    rows[2, 2::3], rows[2, 1::3] = slope[1], -slope[0]
    nu = plate.poisson
    law = plate.bending * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1.0 - nu) / 2.0]])
    return np.asarray(area(corners) * rows.T @ law @ rows)


def alternating_rotations(plate: Plate, corners: Reals) -> Reals:
    """Of a square: E t³ / 36 for the alternating rotation about each axis, as a unit vector."""
    out = np.zeros((3 * len(corners), 3 * len(corners)))
    if len(corners) == 4:
        alternating = 0.5 * np.array([1.0, -1.0, 1.0, -1.0])
        for component in (1, 2):
            out[component::3, component::3] = (
                plate.young * plate.thickness**3 / 36.0 * np.outer(alternating, alternating)
            )
    return out


def _side_shears(plate: Plate, corners: Reals) -> Reals:
    n = len(corners)
    leg = area(corners) * (1.0 if n == 4 else 2.0)
    flexibility = SHEAR[n] / plate.transverse + leg * BENDING[n] / plate.bending
    if n == 3:
        # the tables have the two legs first
        longest = int(np.argmax(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)))
        flexibility = np.roll(flexibility, longest - 2, axis=(0, 1))
    rows = side_shear_rows(corners)
    return np.asarray(rows.T @ np.linalg.solve(flexibility, rows))


def drilling_stiffness(factor: float, plate: Plate, corners: Reals) -> Reals:
    """(3n, 3n) on (u, v, θz) of the corners; `factor` is K6ROT."""
    rows = np.zeros((len(corners), 3 * len(corners)))
    for i in range(len(corners)):
        near = [i, (i + 1) % len(corners), i - 1]
        # derivatives along the two sides of the corner, then along x and y
        slope = np.linalg.inv(corners[near[1:]] - corners[i]) @ np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        for j, by_x, by_y in zip(near, *slope):
            rows[i, 3 * j] += 0.5 * by_y
            rows[i, 3 * j + 1] -= 0.5 * by_x
        rows[i, 3 * i + 2] = 1.0
    in_plane_shear = plate.young / 2.0 / (1.0 + plate.poisson)
    return np.asarray(1e-6 * factor * in_plane_shear * plate.thickness * rows.T @ rows)


def side_shear_rows(corners: Reals) -> Reals:
    """(n, 3n) integrals of the shear along the sides 12, 23, … by linear displacements and rotations."""
    n = len(corners)
    rows = np.zeros((n, 3 * n))
    for i in range(n):
        j = (i + 1) % n
        side = corners[j] - corners[i]
        rows[i, 3 * i], rows[i, 3 * j] = -1.0, 1.0
        for corner in (i, j):
            rows[i, 3 * corner + 1], rows[i, 3 * corner + 2] = -0.5 * side[1], 0.5 * side[0]
    return rows


def mean_gradient(corners: Reals) -> Reals:
    """(2, n) means over the area of the derivatives of the corners' functions."""
    ahead, behind = np.roll(corners, -1, axis=0), np.roll(corners, 1, axis=0)
    across = ahead - behind
    return np.stack([across[:, 1], -across[:, 0]]) / (2.0 * area(corners))


def area(corners: Reals) -> float:
    """Area of a polygon."""
    x, y = corners.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))
