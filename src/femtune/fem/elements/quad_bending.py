"""Bending and transverse shear of a quadrilateral: bilinear rotations, shear tied at the middles of the sides.

Source: Dvorkin and Bathe, Eng. Comput. 1 (1984) 77-88 (MITC4); Bathe and Dvorkin, Int. J. Numer. Meth. Engng 21
(1985) 367-383. The covariant shear along ξ is taken at the middles of the sides η = ±1 and varies linearly between,
that along η at the middles of ξ = ±1; both are integrated at 2 × 2 points with the exact area. The surface x and its
normal n are bilinear, n from the normals that neighbours share at the corners: with d = θ × n, the curvature is
½(x,α·d,β + x,β·d,α + u,α·n,β + u,β·n,α) and the shear x,α·d + u,α·n, which both vanish in rigid motion exactly.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.quad_shape import GAUSS, Point, QuadShape, functions, inverse, slopes
from femtune.fem.elements.shell_strains import Reals

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
