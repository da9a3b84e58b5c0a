"""Membrane of a flat triangle: constant strains, and the turn about the normal; its geometry and its mass."""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.shell_strains import Reals

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


def drilling_rows(corners: Reals, normals: Reals) -> Reals:
    """(m, 3, 3, 6) turn about the shared normal less that of the triangle, at the middles of the sides.

    The triangle turns by w,y about x, by −w,x about y, and by ½(v,x − u,y) about z.
    """
    bx, by = np.moveaxis(tri_gradient(corners)[:, :, None], 1, 0)
    n = MIDDLES @ normals
    x, y, z = np.moveaxis(n[:, :, None], 3, 0)
    out = np.empty((len(corners), 3, 3, 6))
    out[..., 0], out[..., 1], out[..., 2] = 0.5 * z * by, -0.5 * z * bx, y * bx - x * by
    out[..., 3:] = MIDDLES[:, :, None] * n[:, :, None]
    return np.asarray(out * (np.sqrt(tri_area(corners)) / ROOT_3)[:, None, None, None])
