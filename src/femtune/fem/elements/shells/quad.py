"""The four-node shell: hybrid membrane, tied shear, drilling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.shells.drilling import drilling_rows
from femtune.fem.elements.shells.placement import ShellPlane
from femtune.fem.elements.shells.strains import IN_PLANE, ShellFormulation, ShellStrains, placed

# ----------------------------------------------------------------------------------------------------
# Bilinear geometry of a quadrilateral, warped or flat, on the axes of its mean plane.


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


# ----------------------------------------------------------------------------------------------------
# Bending and transverse shear of a quadrilateral: bilinear rotations, shear tied at the middles of the sides.
#
# Source: Dvorkin and Bathe, Eng. Comput. 1 (1984) 77-88 (MITC4); Bathe and Dvorkin, Int. J. Numer. Meth. Engng 21
# (1985) 367-383. The covariant shear along ξ is taken at the middles of the sides η = ±1 and varies linearly between,
# that along η at the middles of ξ = ±1; both are integrated at 2 × 2 points with the exact area. The surface x and
# its normal n are bilinear, n from the normals that neighbours share at the corners: with d = θ × n, the curvature is
# ½(x,α·d,β + x,β·d,α + u,α·n,β + u,β·n,α) and the shear x,α·d + u,α·n, which both vanish in rigid motion exactly.


TIES: tuple[tuple[Point, Point], ...] = (((0.0, -1.0), (0.0, 1.0)), ((-1.0, 0.0), (1.0, 0.0)))


def bending_rows(shape: QuadShape) -> Reals:
    """(m, 4, 3, 4, 6) curvatures at 2 × 2 points, times the root of the weight."""
    out = np.empty((len(shape.area), 4, 3, 4, 6))
    for k, point in enumerate(GAUSS):
        weight = np.sqrt(shape.jacobian(point))[:, None, None]
        tensor = _cartesian(inverse(shape.bases(point)[:, :, :2]), _covariant_bending(shape, point))
        out[:, k, 0], out[:, k, 1] = tensor[:, 0, 0] * weight, tensor[:, 1, 1] * weight
        out[:, k, 2] = (tensor[:, 0, 1] + tensor[:, 1, 0]) * weight
    return out


def _covariant_bending(shape: QuadShape, point: Point) -> Reals:
    """(m, 2, 2, 4, 6) rows x,α·d,β + u,α·n,β on (α, β)."""
    slope, arms = slopes(point), _arms(shape, point)
    out = np.empty((len(arms), 2, 2, 4, 6))
    out[..., :3] = slope[:, None, :, None] * (slope @ shape.normals)[:, None, :, None, :]
    out[..., 3:] = slope[None, None, :, :, None] * arms[:, :, None]
    return out


def _arms(shape: QuadShape, point: Point) -> Reals:
    """(m, 2, 4, 3) vectors nᵢ × x,α, so that x,α·d = Σ Nᵢ (nᵢ × x,α)·θᵢ."""
    return np.cross(shape.normals[:, None], shape.bases(point)[:, :, None])


def _cartesian(turn: Reals, tensor: Reals) -> Reals:
    """(m, 2, 2, 4, 6) tensor on x and y from the one on ξ and η; `turn` (m, 2, 2) are the derivatives ∂ξα/∂xᵢ."""
    m = len(turn)
    first = (turn @ tensor.reshape(m, 2, -1)).reshape(m, 2, 2, -1)
    return np.asarray((turn[:, None] @ first).reshape(tensor.shape))


def shear_rows(shape: QuadShape) -> Reals:
    """(m, 4, 2, 4, 6) transverse shear at 2 × 2 points, times the root of the weight."""
    tied = [[_covariant_shear(shape, point, i) for point in pair] for i, pair in enumerate(TIES)]
    out = np.empty((len(shape.area), 4, 2, 4, 6))
    for k, (xi, eta) in enumerate(GAUSS):
        covariant = [0.5 * ((1.0 - s) * a + (1.0 + s) * b) for s, (a, b) in zip((eta, xi), tied)]
        turn = inverse(shape.bases((xi, eta))[:, :, :2]) * np.sqrt(shape.jacobian((xi, eta)))[:, None, None]
        flat = np.stack(covariant, axis=1).reshape(len(turn), 2, -1)
        out[:, k] = (turn @ flat).reshape(out[:, k].shape)
    return out


def _covariant_shear(shape: QuadShape, point: Point, i: int) -> Reals:
    """(m, 4, 6) shear x,α·d + u,α·n along ξ (i = 0) or η (i = 1)."""
    n = functions(point)
    out = np.empty((len(shape.area), 4, 6))
    out[:, :, :3] = slopes(point)[i][:, None] * (n @ shape.normals)[:, None]
    out[:, :, 3:] = n[:, None] * _arms(shape, point)[:, i]
    return out


# ----------------------------------------------------------------------------------------------------
# Membrane of a quadrilateral: mean strains, and two bending modes in the plane that meet uniaxial stress.
#
# The mean of the bilinear element's strains passes the patch test on any shape. What they leave of the displacements
# is the hourglass q ξη; the strain that it causes along a side's direction varies linearly across and meets uniaxial
# stress. For a parallelogram that is the hybrid element of Pian and Sumihara (Int. J. Numer. Meth. Engng 20, 1984,
# 1685-1695) exactly; the split into mean strains and stabilised hourglasses is that of Belytschko and Bachrach
# (Comput. Methods Appl. Mech. Engrg 54, 1986, 279-301). The heights h (1, −1, 1, −1) of a warped element make an
# hourglass of a rigid turn, −h ∇w, which is taken off; the mean strains do not see it.


def hourglass(shape: QuadShape) -> Reals:
    """(m, 2, 4, 6) rows q with (u, v) = rigid + linear + q ξη; rigid motion and linear fields have q = 0."""
    moments = HOURGLASS @ shape.flat
    gamma = 0.25 * (HOURGLASS - np.einsum("mi,mia->ma", moments, shape.mean_gradient))
    out = np.zeros((len(gamma), 2, 4, 6))
    out[:, 0, :, 0] = out[:, 1, :, 1] = gamma
    height = 0.25 * shape.corners[:, :, 2] @ HOURGLASS
    out[:, :, :, 2] = height[:, None, None] * shape.mean_gradient
    return out


def membrane_rows(shape: QuadShape) -> Reals:
    """(m, 1, 3, 4, 6) mean strains, times the root of the area."""
    bx, by = np.moveaxis(shape.mean_gradient * np.sqrt(shape.area)[:, None, None], 1, 0)
    zero = np.zeros_like(bx)
    pairs = [[bx, zero], [zero, by], [by, bx]]
    return placed(np.stack([np.stack(pair, axis=-1) for pair in pairs], axis=1)[:, None], IN_PLANE)


def uniaxial_rows(shape: QuadShape) -> tuple[Reals, Reals]:
    """(m, 2, 4, 6) strains of in-plane bending, and their directions (m, 2, 2).

    Along ĝ1 the strain is η ĝ1·q/|g1|, along ĝ2 it is ξ ĝ2·q/|g2|; the mean squares of ξ and η are a third.
    """
    size = np.linalg.norm(shape.sides, axis=2)
    along = shape.sides / size[:, :, None]
    weight = np.sqrt(shape.area / 3.0)[:, None] / size
    return np.einsum("mk,mki,miac->mkac", weight, along, hourglass(shape)), along


def quad_strains(plane: ShellPlane) -> ShellStrains:
    """Strain rows of quadrilaterals."""
    shape = quad_shape(plane)
    uniaxial, along = uniaxial_rows(shape)
    roots = np.sqrt(np.stack([shape.jacobian(point) for point in GAUSS], axis=1))
    return ShellStrains(
        membrane_rows(shape),
        uniaxial,
        along,
        drilling_rows(shape.corners, shape.normals),
        bending_rows(shape),
        shear_rows(shape),
        roots,
    )


QUAD = ShellFormulation(2, quad_strains, quad_shares)
