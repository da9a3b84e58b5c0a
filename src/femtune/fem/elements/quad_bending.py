"""Bending and transverse shear of a flat quadrilateral: bilinear rotations, shear tied at the middles of the sides.

Source: Dvorkin and Bathe, Eng. Comput. 1 (1984) 77-88 (MITC4); Bathe and Dvorkin, Int. J. Numer. Meth. Engng 21
(1985) 367-383. The covariant shear along ξ is taken at the middles of the sides η = ±1 and varies linearly between,
that along η at the middles of ξ = ±1; both are integrated at 2 × 2 points with the exact area.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.quad_shape import GAUSS, Point, QuadShape, gradients, inverse
from femtune.fem.elements.shell_strains import Reals

TIES: tuple[tuple[Point, Point], ...] = (((0.0, -1.0), (0.0, 1.0)), ((-1.0, 0.0), (1.0, 0.0)))


def bending_rows(shape: QuadShape) -> Reals:
    """(m, 4, 3, 4, 3) curvatures at 2 × 2 points from (w, θx, θy), times the root of the weight."""
    out = np.zeros((len(shape.area), 4, 3, 4, 3))
    for k, point in enumerate(GAUSS):
        bx, by = np.moveaxis(gradients(shape, point) * np.sqrt(shape.jacobian(point))[:, None, None], 1, 0)
        out[:, k, 0, :, 2] = out[:, k, 2, :, 1] = bx
        out[:, k, 1, :, 1] = out[:, k, 2, :, 2] = by
        out[:, k, 1, :, 1] *= -1.0
        out[:, k, 2, :, 1] *= -1.0
    return out


def shear_rows(shape: QuadShape) -> Reals:
    """(m, 4, 2, 4, 3) transverse shear at 2 × 2 points from (w, θx, θy), times the root of the weight."""
    tied = [[_covariant(shape, point, i) for point in pair] for i, pair in enumerate(TIES)]
    out = np.empty((len(shape.area), 4, 2, 4, 3))
    for k, (xi, eta) in enumerate(GAUSS):
        covariant = [0.5 * ((1.0 - s) * a + (1.0 + s) * b) for s, (a, b) in zip((eta, xi), tied)]
        turn = inverse(shape.bases((xi, eta))) * np.sqrt(shape.jacobian((xi, eta)))[:, None, None]
        out[:, k] = np.einsum("mij,jmac->miac", turn, np.array(covariant))
    return out


def _covariant(shape: QuadShape, point: Point, i: int) -> Reals:
    """(m, 4, 3) shear along ξ (i = 0) or η (i = 1): w,ᵢ + x,ᵢ θy − y,ᵢ θx."""
    base, n = shape.bases(point)[:, i], shape.functions(point)
    out = np.empty((len(base), 4, 3))
    out[:, :, 0] = shape.slopes(point)[i]
    out[:, :, 1], out[:, :, 2] = -base[:, 1:] * n, base[:, :1] * n
    return out
