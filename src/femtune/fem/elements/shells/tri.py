"""The three-node shell: constant strains, tied shear with residual bending flexibility, drilling."""

from __future__ import annotations

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.placement import cross_matrix
from femtune.fem.elements.shells.drilling import drilling_rows
from femtune.fem.elements.shells.placement import ShellPlane
from femtune.fem.elements.shells.quad import inverse
from femtune.fem.elements.shells.residual import ResidualFlexibility, of_one_size
from femtune.fem.elements.shells.strains import ABOUT_NORMAL, IN_PLANE, ShellFormulation, ShellStrains, placed

# ----------------------------------------------------------------------------------------------------
# Membrane of a flat triangle: constant strains and the rotation about the normal; geometry and mass.


MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])
"""The corners' functions at the middles of the sides 12, 23 and 31; a mean over these is exact for products of two."""

ROOT_3 = np.sqrt(3.0)


def tri_area(corners: Reals) -> Reals:
    """(m,) areas of triangles with corners (m, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))


def mean_square_side(corners: Reals) -> Reals:
    """(m,) means of the squared lengths of the sides; corners (m, 3, 2) or (m, 3, 3)."""
    return np.asarray(((np.roll(corners, -1, axis=1) - corners) ** 2).sum(axis=(1, 2)) / 3.0)


def tri_gradient(corners: Reals) -> Reals:
    """(m, 2, 3) derivatives of the corners' functions by x and y."""
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    turned = np.stack([-opposite[:, :, 1], opposite[:, :, 0]], axis=1)
    return np.asarray(turned / (2.0 * tri_area(corners))[:, None, None])


def tri_shares(corners: Reals) -> Reals:
    """(m, 3, 3) integrals of Nᵢ Nⱼ over the area."""
    return np.asarray(tri_area(corners)[:, None, None] * (np.ones((3, 3)) + np.eye(3)) / 12.0)


def membrane_rows(corners: Reals) -> Reals:
    """(m, 1, 3, 3, 2) strains from (u, v), times the root of the area."""
    bx, by = np.moveaxis(tri_gradient(corners) * np.sqrt(tri_area(corners))[:, None, None], 1, 0)
    zero = np.zeros_like(bx)
    pairs = [[bx, zero], [zero, by], [by, bx]]
    return np.stack([np.stack(pair, axis=-1) for pair in pairs], axis=1)[:, None]


# ----------------------------------------------------------------------------------------------------
# Bending and transverse shear of a flat triangle: linear rotations, shear tied along the sides.
#
# Source: Lee and Bathe, Computers and Structures 82 (2004) 945-962 (MITC3). The mean shear along each side is that of
# linear displacements; the shear between is linear, and its component along a side is constant on that side. Each
# corner has a director n, the normal that the element shares with its neighbours; it moves by θ × n.


def bending_rows(corners: Reals, normals: Reals) -> Reals:
    """(m, 1, 3, 3, 6) curvatures, times the root of the area.

    With b = θ × n: xx is b_x,x + u,x·n,x and xy is b_x,y + b_y,x + u,x·n,y + u,y·n,x. All curvatures are constant, and
    zero in rigid motion.
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
    """(m, 3, 3, 6) integrals of the shear along the sides 12, 23 and 31, from the means of b and n on each side."""
    out, moves = np.zeros((len(corners), 3, 3, 6)), director_moves(normals)[:, :, :2]
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        side = corners[:, j] - corners[:, i]
        mean = 0.5 * (normals[:, i] + normals[:, j])
        out[:, k, i, :3], out[:, k, j, :3] = -mean, mean
        for corner in (i, j):
            out[:, k, corner, 3:] = 0.5 * np.einsum("mi,mij->mj", side, moves[:, corner])
    return out


RESIDUAL_FLEXIBILITY = 12.0 / 15.0
"""Residual bending flexibility h²/15D of a triangle, relative to that of MacNeal's beam, h²/12D.

It represents the bending that linear rotations cannot. Chosen by measurement: docs/theory/shell-triangles.md
"""


def tri_strains(plane: ShellPlane) -> ShellStrains:
    """Strain rows of flat triangles."""
    corners, normals = plane.corners, plane.normals
    return ShellStrains(
        placed(membrane_rows(corners), IN_PLANE),
        None,
        drilling_rows(np.concatenate([corners, plane.heights[:, :, None]], axis=2), normals),
        bending_rows(corners, normals),
        shear_rows(corners, normals),
    )


def tri_residual(xyz: Reals) -> ResidualFlexibility:
    """12h²/15 of triangles with corners `xyz` (e, 3, 3); h² is the mean of the squared sides, in classes.

    The classes are the largest h² divided by powers of √2, so that triangles of one size share one coefficient. No h²
    of a regular refinement is near the limit of a class.
    """
    squares = mean_square_side(xyz)
    largest = squares.max(initial=0.0)
    steps = np.floor(2.0 * np.log2(largest / squares) + 0.37)
    return of_one_size(RESIDUAL_FLEXIBILITY * largest * 2.0 ** (-0.5 * steps))


TRI = ShellFormulation(0, tri_strains, tri_shares, tri_residual)


# ----------------------------------------------------------------------------------------------------
# Membrane with rotations about the normal (CTRIAR): Allman, Computers and Structures 19 (1984) 1-8.
#
# A side bends as a beam between the rotations of its corners: its middle is l(θi − θj)/8 away from the chord. Equal
# rotations of all corners cause no strain; a weak spring resists them.


EQUAL_ROTATION_STIFFNESS = 1e-4
"""Stiffness against equal rotations of all corners, relative to G t: the drilling stiffness of K6ROT = 100.

Small enough to leave the membrane unaffected, large enough to keep the stiffness matrix well conditioned.
"""


def rotation_rows(corners: Reals) -> Reals:
    """(m, 3, 3, 3, 3) strains at the middles of the sides from (u, v, θ) of corners, times the root of the weight."""
    gradient = tri_gradient(corners) * (np.sqrt(tri_area(corners)) / ROOT_3)[:, None, None]
    rows = np.zeros((len(corners), 3, 3, 3, 3))
    bx, by = gradient[:, None, 0], gradient[:, None, 1]
    rows[:, :, 0, :, 0], rows[:, :, 1, :, 1] = bx, by
    rows[:, :, 2, :, 0], rows[:, :, 2, :, 1] = by, bx
    for i, j in ((0, 1), (1, 2), (2, 0)):
        side = corners[:, j] - corners[:, i]
        leaves = np.stack([-side[:, 1], side[:, 0]], axis=1) / 8.0
        for place, middle in enumerate(MIDDLES):
            g = 4.0 * (middle[i] * gradient[:, :, j] + middle[j] * gradient[:, :, i])
            strain = np.stack(
                [g[:, 0] * leaves[:, 0], g[:, 1] * leaves[:, 1], g[:, 1] * leaves[:, 0] + g[:, 0] * leaves[:, 1]],
                axis=1,
            )
            rows[:, place, :, i, 2] += strain
            rows[:, place, :, j, 2] -= strain
    return rows


def tri_rotation_strains(plane: ShellPlane) -> ShellStrains:
    """Strain rows of flat triangles whose rotations about the normal belong to the membrane."""
    flat = tri_strains(plane)
    held = np.zeros((len(plane.corners), 3, 3, 3, 6))
    held[:, :, 2] = np.sqrt(EQUAL_ROTATION_STIFFNESS) * flat.drilling
    membrane = np.concatenate([placed(rotation_rows(plane.corners), ABOUT_NORMAL), held], axis=1)
    bending = np.zeros_like(membrane)
    bending[:, :3] = flat.bending / ROOT_3
    return ShellStrains(membrane, None, np.zeros_like(flat.drilling), bending, flat.shear)


TRI_ROTATION = ShellFormulation(0, tri_rotation_strains, tri_shares, tri_residual)
