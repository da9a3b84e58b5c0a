"""Membrane of a flat quadrilateral: mean strains, and two bending modes in the plane that meet uniaxial stress.

The mean of the bilinear element's strains passes the patch test on any shape. What they leave of the displacements is
the hourglass q ξη; the strain that it causes along a side's direction varies linearly across and meets uniaxial stress.
For a parallelogram that is the hybrid element of Pian and Sumihara (Int. J. Numer. Meth. Engng 20, 1984, 1685-1695)
exactly; the split into mean strains and stabilised hourglasses is that of Belytschko and Bachrach (Comput. Methods
Appl. Mech. Engrg 54, 1986, 279-301).
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.quad_shape import GAUSS, QuadShape, gradients
from femtune.fem.elements.shell_strains import Reals

HOURGLASS = np.array([1.0, -1.0, 1.0, -1.0])


def hourglass(shape: QuadShape) -> Reals:
    """(m, 4) rows γ with u = constant + linear + (γ·u) ξη; constant and linear fields have γ·u = 0."""
    moments = HOURGLASS @ shape.corners
    return np.asarray(0.25 * (HOURGLASS - np.einsum("mi,mia->ma", moments, shape.mean_gradient)))


def membrane_rows(shape: QuadShape) -> Reals:
    """(m, 1, 3, 4, 2) mean strains from (u, v), times the root of the area."""
    bx, by = np.moveaxis(shape.mean_gradient * np.sqrt(shape.area)[:, None, None], 1, 0)
    zero = np.zeros_like(bx)
    pairs = [[bx, zero], [zero, by], [by, bx]]
    return np.stack([np.stack(pair, axis=-1) for pair in pairs], axis=1)[:, None]


def uniaxial_rows(shape: QuadShape) -> tuple[Reals, Reals]:
    """(m, 2, 4, 2) strains of in-plane bending from (u, v), and their directions (m, 2, 2).

    Along ĝ1 the strain is η ĝ1·q/|g1|, along ĝ2 it is ξ ĝ2·q/|g2|; the mean squares of ξ and η are a third.
    """
    size = np.linalg.norm(shape.sides, axis=2)
    along = shape.sides / size[:, :, None]
    weight = np.sqrt(shape.area / 3.0)[:, None] / size
    rows = weight[:, :, None, None] * hourglass(shape)[:, None, :, None] * along[:, :, None, :]
    return rows, along


def drilling_rows(shape: QuadShape) -> Reals:
    """(m, 4, 4, 3) turn about the normal less the membrane's rotation at four points, from (u, v, θz).

    In pure bending the rotation of the sides varies twice as much as that of the bilinear displacements.
    """
    out = np.zeros((len(shape.area), 4, 4, 3))
    for k, point in enumerate(GAUSS):
        slope = gradients(shape, point)
        varying = 2.0 * slope - shape.mean_gradient
        root = np.sqrt(shape.jacobian(point))[:, None]
        out[:, k, :, 0], out[:, k, :, 1] = 0.5 * root * varying[:, 1], -0.5 * root * varying[:, 0]
        out[:, k, :, 2] = root * shape.functions(point)
    return out
