"""Mean strains of a first-order solid, and the remaining modes, which have assumed stresses.

The mean of the strains over the volume passes the patch test on any shape, and gives one volume constraint per
element. Modes are functions h_k(ξ, η, ζ) beyond the linear ones: u = linear + Σ h_k q_k, q_k = γ_kᵀ u, with γ_k
orthogonal to constant and linear fields on the distorted shape too.
Sources: Flanagan and Belytschko, Int. J. Numer. Meth. Engng 17 (1981) 679-706 (mean strains, γ); Pian and Tong, Int. J.
Numer. Meth. Engng 22 (1986) 173-181 (the stresses that are assumed).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.differential import Differential, of_solid
from femtune.fem.elements.solids.shape import SolidPoints
from femtune.fem.elements.solids.strains import StrainGroup
from femtune.fem.structure import ElementBatch, Structure

MEAN = 1.0 / np.sqrt(3.0)
"""Root of the mean square of ξ over −1 … 1."""


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference shape of a solid: its functions at points, their derivatives, and its modes.

    Parameters
    ----------
    functions : (k, n) at the integration points, `derivatives` (k, 3, n) by ξ, η, ζ there, `weights` (k,)
    corner_derivatives : (c, 3, n) at the points where the shape is checked
    centre : (3, n) derivatives whose values are the axes g1, g2, g3 of the element
    modes : (h, n) rows that give the factors q of the modes of displacements that are otherwise linear
    """

    functions: Reals
    derivatives: Reals
    weights: Reals
    corner_derivatives: Reals
    centre: Reals
    modes: Reals

    def shares(self, xyz: Reals) -> Reals:
        """(m, n, n) integrals of products of the shape functions."""
        volume = np.linalg.det(jacobians(self.derivatives, xyz)) * self.weights
        out = (self.functions.T * volume[:, None, :]) @ self.functions
        return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)))

    def checked(self, xyz: Reals) -> Reals:
        """(m, c, 3, 3) Jacobians at the points where the shape is checked."""
        return jacobians(self.corner_derivatives, xyz)


def reference(
    functions: Callable[[Reals], Reals],
    derivatives: Callable[[Reals], Reals],
    points: SolidPoints,
    checked: Reals,
    centre: Reals,
    modes: Reals,
) -> Reference:
    """A reference shape from its functions (k, 3) -> (k, n), their derivatives -> (k, 3, n) and its points."""
    at, middle = points.places, derivatives(np.atleast_2d(centre))[0]
    return Reference(functions(at), derivatives(at), points.weights, derivatives(checked), middle, modes)


def jacobians(derivatives: Reals, xyz: Reals) -> Reals:
    """(m, k, 3, 3) columns: derivatives of the position by ξ, η, ζ.

    One product per element, as everywhere here: in one of all elements, rounding would depend on an element's index.
    """
    k, _, n = derivatives.shape
    sides = np.swapaxes(xyz, 1, 2) @ derivatives.reshape(3 * k, n).T
    return np.swapaxes(sides.reshape(len(xyz), 3, k, 3), 1, 2)


def first_order_differential(batch: ElementBatch, structure: Structure, shape: Reference) -> Differential:
    """Differential stiffness of the mean stresses of a batch."""
    jacobian = jacobians(shape.derivatives, structure.nodes.xyz[batch.nodes])
    slopes = np.swapaxes(shape.derivatives, 1, 2)[None] @ np.linalg.inv(jacobian)
    return of_solid(batch, structure, slopes, np.linalg.det(jacobian) * shape.weights)


def cofactors(jacobian: Reals) -> Reals:
    """(…, 3, 3) columns g2 × g3, g3 × g1, g1 × g2 of the columns g: determinant times the inverse's transpose."""
    one, two = np.roll(jacobian, -1, axis=-1), np.roll(jacobian, -2, axis=-1)
    return np.roll(one, -1, axis=-2) * np.roll(two, -2, axis=-2) - np.roll(one, -2, axis=-2) * np.roll(two, -1, axis=-2)


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """m solids of first order.

    Parameters
    ----------
    volume : (m,)
    mean_gradient : (m, 3, n) mean derivatives of the shape functions by x, y, z
    sides : (m, 3, 3) rows g1, g2, g3: derivatives of the position by ξ, η, ζ in the middle
    gamma : (m, h, n) rows γ_k that give the factors of the modes
    """

    volume: Reals
    mean_gradient: Reals
    sides: Reals
    gamma: Reals

    def full(self) -> StrainGroup:
        """Mean strains, times the square root of the volume."""
        gradient = self.mean_gradient * np.sqrt(self.volume)[:, None, None]
        m, _, n = gradient.shape
        rows = np.zeros((m, 1, 6, n, 3))
        for i in range(3):
            j = (i + 1) % 3
            rows[:, 0, i, :, i] = gradient[:, i]
            rows[:, 0, 3 + i, :, i], rows[:, 0, 3 + i, :, j] = gradient[:, j], gradient[:, i]
        return StrainGroup(rows)

    def size(self, i: int) -> Reals:
        """(m,) length of a side."""
        return np.linalg.norm(self.sides[:, i], axis=1)

    def along(self, i: int) -> Reals:
        """(m, 3) unit vector along a side."""
        return np.asarray(self.sides[:, i] / self.size(i)[:, None])


def first_order(shape: Reference, xyz: Reals) -> FirstOrder:
    """The element's volume, mean gradient, axes and modes."""
    jacobian = jacobians(shape.derivatives, xyz)
    inverse = cofactors(jacobian)
    whole = np.sum(np.sum(jacobian[..., 0] * inverse[..., 0], axis=-1) * shape.weights, axis=1)
    # the determinant times a gradient is a cofactor times a derivative
    k, _, n = shape.derivatives.shape
    weighted = (shape.derivatives * shape.weights[:, None, None]).reshape(3 * k, n)
    mean = np.swapaxes(inverse, 1, 2).reshape(len(xyz), 3, 3 * k) @ weighted / whole[:, None, None]
    gamma = shape.modes - (shape.modes @ xyz) @ mean
    return FirstOrder(whole, mean, shape.centre @ xyz, gamma)


def plane_frame(one: Reals, two: Reals) -> Reals:
    """(m, 3, 3) columns x along `one`, y in the plane of both, z normal to it."""
    x = one / np.linalg.norm(one, axis=1)[:, None]
    z = np.cross(one, two)
    z /= np.linalg.norm(z, axis=1)[:, None]
    return np.stack([x, np.cross(z, x), z], axis=2)


def plane_duals(one: Reals, two: Reals, frame: Reals) -> tuple[Reals, Reals]:
    """Vectors (m, 2) on the frame's x and y whose products with the sides `one` and `two` are 1 and 0."""
    sides = np.stack([one, two], axis=1) @ frame[:, :, :2]
    dual = np.asarray(np.linalg.inv(sides), float)
    return dual[:, :, 0], dual[:, :, 1]


def plane_mode(element: FirstOrder, i: int, j: int, modes: tuple[int, int], weight: Reals) -> StrainGroup:
    """Strains in the plane of sides i and j of a displacement ζ (ξ q_a + η q_b), with ζ left out.

    `weight` (m,) is the root of the integral of ζ² over the volume.
    """
    frame = plane_frame(element.sides[:, i], element.sides[:, j])
    duals = plane_duals(element.sides[:, i], element.sides[:, j], frame)
    # derivative along the frame's x and y of the displacement, as a vector
    slope = [
        sum((d[:, a, None] * element.gamma[:, k] for d, k in zip(duals, modes)), np.zeros(()))[:, :, None]
        for a in range(2)
    ]
    x, y = frame[:, None, :, 0], frame[:, None, :, 1]
    rows = np.stack([slope[0] * x, slope[1] * y, slope[1] * x + slope[0] * y], axis=1)
    return StrainGroup((rows * weight[:, None, None, None])[:, None], frame)


def uniaxial_mode(element: FirstOrder, i: int, rows: Reals) -> StrainGroup:
    """Strains along side i, where `rows` (m, r, n) give the derivative of the displacement along it, by its ξ."""
    along = element.along(i)
    rows = rows / element.size(i)[:, None, None]
    frame = plane_frame(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    return StrainGroup((rows[..., None] * along[:, None, None, :])[:, :, None], frame)
