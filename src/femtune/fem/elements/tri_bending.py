"""Bending and transverse shear of a flat triangle: linear rotations, shear tied along the sides.

Source: Lee and Bathe, Computers and Structures 82 (2004) 945-962 (MITC3). The mean shear along each side is that of
linear displacements; the shear between is linear, and its component along a side is constant on that side. Each
corner has a director n, the normal that the element shares with its neighbours; it moves by θ × n.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.placement import cross_matrix
from femtune.fem.elements.quad_shape import inverse
from femtune.fem.elements.shell_strains import Reals
from femtune.fem.elements.tri_membrane import MIDDLES, ROOT_3, tri_area, tri_gradient


def bending_rows(corners: Reals, normals: Reals) -> Reals:
    """(m, 1, 3, 3, 6) curvatures, times the root of the area.

    With b = θ × n: xx is b_x,x + u,x·n,x and xy is b_x,y + b_y,x + u,x·n,y + u,y·n,x. All of it is constant, and a
    rigid motion has none.
    """
    bx, by = np.moveaxis(tri_gradient(corners)[..., None], 1, 0)
    turn_x, turn_y = np.moveaxis(director_moves(normals)[:, :, :2], 2, 0)
    nx, ny = ((b * normals).sum(axis=1)[:, None] for b in (bx, by))
    moved = np.stack([bx * nx, by * ny, bx * ny + by * nx], axis=1)
    turned = np.stack([bx * turn_x, by * turn_y, by * turn_x + bx * turn_y], axis=1)
    rows = np.concatenate([moved, turned], axis=-1)
    return np.asarray(rows * np.sqrt(tri_area(corners))[:, None, None, None])[:, None]


def director_moves(normals: Reals) -> Reals:
    """(m, 3, 3, 3) motion θ × n of the director of each corner, from θ of the corner."""
    return -cross_matrix(normals.reshape(-1, 3)).reshape(-1, 3, 3, 3)


def shear_rows(corners: Reals, normals: Reals) -> Reals:
    """(m, 3, 2, 3, 6) transverse shear at the middles of the sides, times the root of the weight.

    With r along side 12 and s along side 13 the covariant shears are g₁₂ + c s and g₁₃ − c r; c = −(g₁₂ + g₂₃ + g₃₁)
    makes the shear along side 23 constant and equal to g₂₃.
    """
    g = side_shears(corners, normals)
    c = -g.sum(axis=1)
    bases = corners[:, 1:] - corners[:, :1]
    weight = np.sqrt(tri_area(corners)) / ROOT_3
    turn = inverse(bases) * weight[:, None, None]
    r, s = MIDDLES[:, 1], MIDDLES[:, 2]
    covariant = np.stack([[g[:, 0] + c * sk, -g[:, 2] - c * rk] for rk, sk in zip(r, s)])
    return np.einsum("mij,kjmac->mkiac", turn, covariant)


def side_shears(corners: Reals, normals: Reals) -> Reals:
    """(m, 3, 3, 6) integrals of the shear along the sides 12, 23 and 31: means of b along, and of n on the stretch."""
    out, moves = np.zeros((len(corners), 3, 3, 6)), director_moves(normals)[:, :, :2]
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        side = corners[:, j] - corners[:, i]
        mean = 0.5 * (normals[:, i] + normals[:, j])
        out[:, k, i, :3], out[:, k, j, :3] = -mean, mean
        for corner in (i, j):
            out[:, k, corner, 3:] = 0.5 * np.einsum("mi,mij->mj", side, moves[:, corner])
    return out
