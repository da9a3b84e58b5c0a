"""Bending and transverse shear of a flat triangle: linear rotations, shear tied along the sides.

Source: Lee and Bathe, Computers and Structures 82 (2004) 945-962 (MITC3). The mean shear along each side is that of
linear w, θx and θy; the shear between is linear, and its component along a side is constant on that side.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.quad_shape import inverse
from femtune.fem.elements.shell_strains import Reals
from femtune.fem.elements.tri_membrane import MIDDLES, ROOT_3, drilling_rows, mean_square_side, tri_area, tri_gradient

# part of the twisting stiffness, chosen by measurement: docs/theory/shell-triangles.md
SPIN = 0.3


def bending_rows(corners: Reals) -> Reals:
    """(m, 1, 3, 3, 3) curvatures from (w, θx, θy), times the root of the area."""
    bx, by = np.moveaxis(tri_gradient(corners) * np.sqrt(tri_area(corners))[:, None, None], 1, 0)
    out = np.zeros((len(corners), 1, 3, 3, 3))
    out[:, 0, 0, :, 2], out[:, 0, 1, :, 1] = bx, -by
    out[:, 0, 2, :, 1], out[:, 0, 2, :, 2] = -bx, by
    return out


def shear_rows(corners: Reals) -> Reals:
    """(m, 3, 2, 3, 3) transverse shear at the middles of the sides from (w, θx, θy), times the root of the weight.

    With r along side 12 and s along side 13 the covariant shears are g₁₂ + c s and g₁₃ − c r; c = −(g₁₂ + g₂₃ + g₃₁)
    makes the shear along side 23 constant and equal to g₂₃.
    """
    g = side_shears(corners)
    c = -g.sum(axis=1)
    bases = corners[:, 1:] - corners[:, :1]
    weight = np.sqrt(tri_area(corners)) / ROOT_3
    turn = inverse(bases) * weight[:, None, None]
    r, s = MIDDLES[:, 1], MIDDLES[:, 2]
    covariant = np.stack([[g[:, 0] + c * sk, -g[:, 2] - c * rk] for rk, sk in zip(r, s)])
    return np.einsum("mij,kjmac->mkiac", turn, covariant)


def spin_rows(corners: Reals) -> Reals:
    """(m, 3, 3, 3, 3) a third kind of curvature from (u, v, θz): the turn against the membrane over the element's size.

    Where flat triangles meet at an angle, a part of one's twisting moment is the other's moment about its normal. The
    turn there is therefore held as stiffly as twisting is, in the place of the twisting curvature; without it a strip
    that is twisted and not thin gets softer with every refinement.
    """
    out = np.zeros((len(corners), 3, 3, 3, 3))
    out[:, :, 2] = drilling_rows(corners) * np.sqrt(SPIN / mean_square_side(corners))[:, None, None, None]
    return out


def side_shears(corners: Reals) -> Reals:
    """(m, 3, 3, 3) integrals of the shear along the sides 12, 23 and 31 from (w, θx, θy) of the corners."""
    out = np.zeros((len(corners), 3, 3, 3))
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        side = corners[:, j] - corners[:, i]
        out[:, k, i, 0], out[:, k, j, 0] = -1.0, 1.0
        for corner in (i, j):
            out[:, k, corner, 1], out[:, k, corner, 2] = -0.5 * side[:, 1], 0.5 * side[:, 0]
    return out
