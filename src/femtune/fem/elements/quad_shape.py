"""Bilinear shape functions of a flat quadrilateral."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.fem.elements.shell_strains import Reals

Point = tuple[float, float]

XI = np.array([-1.0, 1.0, 1.0, -1.0])
ETA = np.array([-1.0, -1.0, 1.0, 1.0])
GAUSS: tuple[Point, ...] = tuple((x / np.sqrt(3.0), y / np.sqrt(3.0)) for x, y in zip(XI, ETA))
"""The 2 × 2 points of integration, each of weight one."""


@dataclass(frozen=True, eq=False)
class QuadShape:
    """m flat quadrilaterals.

    Parameters
    ----------
    corners : (m, 4, 2)
    area : (m,)
    sides : (m, 2, 2) base vectors ∂x/∂ξ and ∂x/∂η at the centre: half the mean sides
    mean_gradient : (m, 2, 4) means over the area of the shape functions' derivatives by x and y
    """

    corners: Reals
    area: Reals
    sides: Reals
    mean_gradient: Reals

    @staticmethod
    def functions(point: Point) -> Reals:
        """(4,) shape functions."""
        return np.asarray(0.25 * (1.0 + XI * point[0]) * (1.0 + ETA * point[1]))

    @staticmethod
    def slopes(point: Point) -> Reals:
        """(2, 4) derivatives of the shape functions by ξ and η."""
        return 0.25 * np.array([XI * (1.0 + ETA * point[1]), ETA * (1.0 + XI * point[0])])

    def bases(self, point: Point) -> Reals:
        """(m, 2, 2) base vectors as rows: x,ξ y,ξ and x,η y,η."""
        return np.asarray(self.slopes(point) @ self.corners)

    def jacobian(self, point: Point) -> Reals:
        """(m,) determinant of the base vectors."""
        return determinant(self.bases(point))


def determinant(bases: Reals) -> Reals:
    """(m,) determinants of (m, 2, 2)."""
    return np.asarray(bases[:, 0, 0] * bases[:, 1, 1] - bases[:, 0, 1] * bases[:, 1, 0])


def inverse(bases: Reals) -> Reals:
    """(m, 2, 2) inverses."""
    out = np.empty_like(bases)
    out[:, 0, 0], out[:, 1, 1] = bases[:, 1, 1], bases[:, 0, 0]
    out[:, 0, 1], out[:, 1, 0] = -bases[:, 0, 1], -bases[:, 1, 0]
    return np.asarray(out / determinant(bases)[:, None, None])


def gradients(shape: QuadShape, point: Point) -> Reals:
    """(m, 2, 4) derivatives of the shape functions by x and y at a point."""
    return np.asarray(inverse(shape.bases(point)) @ shape.slopes(point))


def quad_shape(corners: Reals) -> QuadShape:
    """Shape of flat quadrilaterals from their corners (m, 4, 2)."""
    sides = QuadShape.slopes((0.0, 0.0)) @ corners
    # the derivatives at the centre are the means over the area (Flanagan and Belytschko 1981)
    mean = inverse(sides) @ QuadShape.slopes((0.0, 0.0))
    return QuadShape(corners, 4.0 * determinant(sides), sides, mean)


def quad_shares(corners: Reals) -> Reals:
    """(m, 4, 4) integrals of Nᵢ Nⱼ over the area."""
    shape = quad_shape(corners)
    out = np.zeros((len(corners), 4, 4))
    for point in GAUSS:
        n = shape.functions(point)
        out += shape.jacobian(point)[:, None, None] * np.outer(n, n)
    return out
