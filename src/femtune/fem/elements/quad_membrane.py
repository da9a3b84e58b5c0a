"""Membrane of a quadrilateral: mean strains, and two bending modes in the plane that meet uniaxial stress.

The mean of the bilinear element's strains passes the patch test on any shape. What they leave of the displacements is
the hourglass q ξη; the strain that it causes along a side's direction varies linearly across and meets uniaxial stress.
For a parallelogram that is the hybrid element of Pian and Sumihara (Int. J. Numer. Meth. Engng 20, 1984, 1685-1695)
exactly; the split into mean strains and stabilised hourglasses is that of Belytschko and Bachrach (Comput. Methods
Appl. Mech. Engrg 54, 1986, 279-301). The heights h (1, −1, 1, −1) of a warped element make an hourglass of a rigid
turn, −h ∇w, which is taken off; the mean strains do not see it.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.quad_shape import GAUSS, HOURGLASS, QuadShape, functions, gradients
from femtune.fem.elements.shell_strains import IN_PLANE, Reals, placed


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


def drilling_rows(shape: QuadShape) -> Reals:
    """(m, 4, 4, 6) turn about the normal less the membrane's rotation at 2 × 2 points, times the root of the weight.

    In pure bending the rotation of the sides varies twice as much as that of the bilinear displacements.
    """
    q, out = hourglass(shape), np.zeros((len(shape.area), 4, 4, 6))
    for k, point in enumerate(GAUSS):
        varying = 2.0 * (gradients(shape, point) - shape.mean_gradient) @ HOURGLASS
        rotation = varying[:, 0, None, None] * q[:, 1] - varying[:, 1, None, None] * q[:, 0]
        rotation[:, :, 1] += shape.mean_gradient[:, 0]
        rotation[:, :, 0] -= shape.mean_gradient[:, 1]
        out[:, k] = -0.5 * rotation
        out[:, k, :, 5] += functions(point)
        out[:, k] *= np.sqrt(shape.jacobian(point))[:, None, None]
    return out
