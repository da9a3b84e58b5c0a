"""The four-node shell: hybrid membrane and bending, tied shear with residual bending flexibility, drilling."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.shells.drilling import drilling_rows
from femtune.fem.elements.shells.placement import ShellPlane, mean_plane
from femtune.fem.elements.shells.residual import ResidualFlexibility, few_sizes
from femtune.fem.elements.shells.strains import (
    IN_PLANE,
    ShellFormulation,
    ShellStrains,
    TiedShear,
    UniaxialStrains,
    placed,
)

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


TIES: tuple[tuple[Point, Point], ...] = (((0.0, -1.0), (0.0, 1.0)), ((-1.0, 0.0), (1.0, 0.0)))


# ----------------------------------------------------------------------------------------------------
# Bending of a quadrilateral: mean curvatures, and two modes of varying curvature with uniaxial stress.
#
# As in the membrane, the mean curvature of bilinear rotations has the whole law and passes the patch test on any shape.
# The rest of the rotations alternates from corner to corner; the curvature that it causes along a side's direction
# varies linearly across. With the whole law it would lock where transverse stresses are strongly coupled.
#
# The surface x and its normal n are bilinear, n from the normals that neighbours share at the corners: with d = θ × n,
# the curvature is ½(x,α·d,β + x,β·d,α + u,α·n,β + u,β·n,α) and the shear x,α·d + u,α·n, which both vanish in rigid
# motion exactly (Dvorkin and Bathe, Eng. Comput. 1 (1984) 77-88).


def bending_rows(shape: QuadShape) -> Reals:
    """(m, 1, 3, 4, 6) mean curvatures, times the root of the area."""
    mean = np.zeros((len(shape.area), 2, 2, 4, 6))
    for point in GAUSS:
        tensor = _cartesian(inverse(shape.bases(point)[:, :, :2]), _covariant_bending(shape, point))
        mean += tensor * shape.jacobian(point)[:, None, None, None, None]
    mean /= np.sqrt(shape.area)[:, None, None, None, None]
    return np.stack([mean[:, 0, 0], mean[:, 1, 1], mean[:, 0, 1] + mean[:, 1, 0]], axis=1)[:, None]


def varying_bending_rows(shape: QuadShape, mean: Reals) -> Reals:
    """(m, 2, 4, 6) curvatures along ĝ1 and ĝ2 that vary across, from the rows of the `mean` curvatures.

    From the curvature along a side, which varies from one side to the opposite one, the contribution of the mean
    curvature through the change of the side is subtracted: η ĝ1·q/|g1| remains, as in the membrane. The mean squares of
    ξ and η are a third.
    """
    xx, yy, xy = np.moveaxis(mean[:, 0] / np.sqrt(shape.area)[:, None, None, None], 1, 0)
    change = 0.25 * HOURGLASS @ shape.flat
    out = np.empty((len(shape.area), 2, 4, 6))
    for i, (first, second) in enumerate(TIES):
        low, high = (_covariant_bending(shape, point)[:, i, i] for point in (first, second))
        side = shape.sides[:, i]
        steady = 2.0 * np.stack([side[:, 0] * change[:, 0], side[:, 1] * change[:, 1]], axis=1)
        twist = side[:, 0] * change[:, 1] + side[:, 1] * change[:, 0]
        out[:, i] = 0.5 * (high - low) - _times(steady[:, 0], xx) - _times(steady[:, 1], yy) - _times(twist, xy)
        out[:, i] *= (np.sqrt(shape.area / 3.0) / np.sum(side * side, axis=1))[:, None, None]
    return out


def _times(factors: Reals, rows: Reals) -> Reals:
    return np.asarray(factors[:, None, None] * rows)


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


# ----------------------------------------------------------------------------------------------------
# Transverse shear of a quadrilateral, tied at the middles of the sides, with residual bending flexibility.
#
# Source: Dvorkin and Bathe (above; MITC4); Bathe and Dvorkin, Int. J. Numer. Meth. Engng 21 (1985) 367-383. The
# covariant shear along ξ is taken at the middles of the sides η = ±1 and varies linearly between, that along η at the
# middles of ξ = ±1; both are integrated at 2 × 2 points with the exact area.
#
# For a rectangle a × b the bending that bilinear rotations cannot represent has the flexibilities a²/12D and b²/12D for
# mean shear along a and b (MacNeal, Computers and Structures 8 (1978) 175-183). For any quadrilateral they are the
# principal values of G/12D, G = 4 (g1 g1ᵀ + g2 g2ᵀ), whose principal axes are its wide and its narrow direction.


def tied_shear(shape: QuadShape) -> TiedShear:
    """The covariant shears at the middles of the four sides, and from them the mean and the rest of the shear.

    The mean is multiplied by the square root of the area, the rest at 2 × 2 points by the square roots of the weights.
    """
    ties = [_covariant_shear(shape, point, i) for i, pair in enumerate(TIES) for point in pair]
    every = np.empty((len(shape.area), 4, 2, 4))
    for k, (xi, eta) in enumerate(GAUSS):
        covariant = 0.5 * np.array([[1.0 - eta, 1.0 + eta, 0.0, 0.0], [0.0, 0.0, 1.0 - xi, 1.0 + xi]])
        turn = inverse(shape.bases((xi, eta))[:, :, :2]) * np.sqrt(shape.jacobian((xi, eta)))[:, None, None]
        every[:, k] = turn @ covariant
    roots = np.stack([np.sqrt(shape.jacobian(point) / shape.area) for point in GAUSS], axis=1)
    mean = np.einsum("mk,mkit->mit", roots, every)[:, None]
    _, axes = np.linalg.eigh(size_tensor(shape.sides))
    return TiedShear(np.stack(ties, axis=1), mean, every - roots[:, :, None, None] * mean, axes[:, :, 0])


def _covariant_shear(shape: QuadShape, point: Point, i: int) -> Reals:
    """(m, 4, 6) shear x,α·d + u,α·n along ξ (i = 0) or η (i = 1)."""
    n = functions(point)
    out = np.empty((len(shape.area), 4, 6))
    out[:, :, :3] = slopes(point)[i][:, None] * (n @ shape.normals)[:, None]
    out[:, :, 3:] = n[:, None] * _arms(shape, point)[:, i]
    return out


# ----------------------------------------------------------------------------------------------------
# Membrane of a quadrilateral: mean strains, and two in-plane bending modes with uniaxial stress.
#
# The mean of the bilinear element's strains passes the patch test on any shape. The rest of the displacements is the
# hourglass q ξη; the strain that it causes along a side's direction varies linearly across and has uniaxial stress. For
# a parallelogram this is the hybrid element of Pian and Sumihara (Int. J. Numer. Meth. Engng 20, 1984,
# 1685-1695) exactly; the split into mean strains and stabilised hourglasses is that of Belytschko and Bachrach
# (Comput. Methods Appl. Mech. Engrg 54, 1986, 279-301). The heights h (1, −1, 1, −1) of a warped element turn a
# rigid rotation into an hourglass, −h ∇w, which is subtracted; it does not affect the mean strains.


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
    in_plane, along = uniaxial_rows(shape)
    bending = bending_rows(shape)
    return ShellStrains(
        membrane_rows(shape),
        UniaxialStrains(along, in_plane, varying_bending_rows(shape, bending)),
        drilling_rows(shape.corners, shape.normals),
        bending,
        tied_shear(shape),
    )


def size_tensor(sides: Reals) -> Reals:
    """(m, 2, 2) G = 4 (g1 g1ᵀ + g2 g2ᵀ) of half sides (m, 2, 2) as rows: its principal values are squares of sizes."""
    return np.asarray(4.0 * np.swapaxes(sides, 1, 2) @ sides)


def quad_residual(xyz: Reals) -> ResidualFlexibility:
    """Sizes of quadrilaterals with corners `xyz` (e, 4, 3) in their two principal directions."""
    return few_sizes(np.asarray(np.linalg.eigvalsh(size_tensor(slopes((0.0, 0.0)) @ mean_plane(xyz)[1]))))


QUAD = ShellFormulation(2, quad_strains, quad_shares, quad_residual)
