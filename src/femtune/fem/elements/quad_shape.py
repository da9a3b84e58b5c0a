"""Bilinear geometry of a quadrilateral, warped or flat, on the axes of its mean plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.fem.elements.shell_placement import ShellPlane
from femtune.fem.elements.shell_strains import Reals

Point = tuple[float, float]

XI = np.array([-1.0, 1.0, 1.0, -1.0])
ETA = np.array([-1.0, -1.0, 1.0, 1.0])
GAUSS: tuple[Point, ...] = tuple((x / np.sqrt(3.0), y / np.sqrt(3.0)) for x, y in zip(XI.tolist(), ETA.tolist()))
"""The 2 × 2 points of integration, each of weight one."""

HOURGLASS = XI * ETA


@dataclass(frozen=True, eq=False)
class QuadShape:
    """m quadrilaterals.

    Parameters
    ----------
    corners : (m, 4, 3) on the mean plane's axes; heights alternate, h (1, −1, 1, −1)
    normals : (m, 4, 3) unit normals at the corners, shared with the neighbours
    area : (m,) of the projection on the mean plane
    sides : (m, 2, 2) base vectors ∂x/∂ξ and ∂x/∂η at the centre: half the mean sides, in the plane
    mean_gradient : (m, 2, 4) means over the area of the shape functions' derivatives by x and y
    """

    corners: Reals
    normals: Reals
    area: Reals
    sides: Reals
    mean_gradient: Reals

    @property
    def flat(self) -> Reals:
        """(m, 4, 2) corners on the mean plane."""
        return self.corners[:, :, :2]

    def bases(self, point: Point) -> Reals:
        """(m, 2, 3) base vectors as rows: ∂x/∂ξ and ∂x/∂η of the bilinear surface."""
        return np.asarray(slopes(point) @ self.corners)

    def jacobian(self, point: Point) -> Reals:
        """(m,) area of the mean plane for a unit of ξ η."""
        return determinant(self.bases(point)[:, :, :2])


def functions(point: Point) -> Reals:
    """(4,) shape functions."""
    return np.asarray(0.25 * (1.0 + XI * point[0]) * (1.0 + ETA * point[1]))


def slopes(point: Point) -> Reals:
    """(2, 4) derivatives of the shape functions by ξ and η."""
    return 0.25 * np.array([XI * (1.0 + ETA * point[1]), ETA * (1.0 + XI * point[0])])


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
    """(m, 2, 4) derivatives of the shape functions by x and y of the mean plane."""
    return np.asarray(inverse(shape.bases(point)[:, :, :2]) @ slopes(point))


def quad_shape(plane: ShellPlane) -> QuadShape:
    """Shape of quadrilaterals from their corners, heights and shared normals."""
    centre = slopes((0.0, 0.0))
    sides = centre @ plane.corners
    # the derivatives at the centre are the means over the area (Flanagan and Belytschko 1981)
    mean = inverse(sides) @ centre
    warped = np.concatenate([plane.corners, plane.heights[:, :, None]], axis=2)
    return QuadShape(warped, plane.normals, 4.0 * determinant(sides), sides, mean)


def quad_shares(corners: Reals) -> Reals:
    """(m, 4, 4) integrals of Nᵢ Nⱼ over the area, from corners (m, 4, 2)."""
    out = np.zeros((len(corners), 4, 4))
    for point in GAUSS:
        n = functions(point)
        out += determinant(slopes(point) @ corners)[:, None, None] * np.outer(n, n)
    return out
