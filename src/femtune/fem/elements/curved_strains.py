"""Covariant strains of curved shells as rows on (u, θ) of each node, in the basic frame.

The director n is interpolated from the nodes' normals and moves by d = Σ Nᵢ θᵢ × nᵢ. With x the place and u the
displacement, the strain at the height z above the surface is e + z k:

    e_αβ = ½ (x,α·u,β + x,β·u,α),  k_αβ = ½ (x,α·d,β + x,β·d,α + n,α·u,β + n,β·u,α),  γ_α = x,α·d + n·u,α

All of them vanish in rigid motion exactly, whatever x and n are.
"""

from __future__ import annotations

import numpy as np

from femtune.fem.elements.curved_shape import Reals
from femtune.fem.elements.curved_surface import Surface


def membrane(surface: Surface) -> Reals:
    """(m, p, 3, n, 6) strains rr, ss and engineering rs."""
    slopes = surface.functions[:, :, 1:]
    out = _zeros(surface, 3)
    out[..., :3] = _paired(surface.bases[:, :, :, None], slopes)
    return out


def curvature(surface: Surface) -> Reals:
    """(m, p, 3, n, 6) curvatures rr, ss and engineering rs."""
    slopes = surface.functions[:, :, 1:]
    out = _zeros(surface, 3)
    out[..., :3] = _paired(surface.director[:, :, 1:, None], slopes)
    out[..., 3:] = _paired(_arms(surface), slopes)
    return out


def shear(surface: Surface) -> Reals:
    """(m, p, 2, n, 6) transverse shear along r and s."""
    functions = surface.functions
    out = _zeros(surface, 2)
    out[..., :3] = functions[:, :, 1:, :, None] * surface.director[:, :, :1, None]
    out[..., 3:] = functions[:, :, :1, :, None] * _arms(surface)
    return out


def turning(surface: Surface) -> Reals:
    """(m, p, 1, n, 6) turn about the normal less the surface's own."""
    functions, bases = surface.functions[..., None], surface.bases[:, :, :, None]
    out = _zeros(surface, 1)
    size = 2.0 * surface.area[:, :, None, None]
    out[:, :, 0, :, :3] = (functions[:, :, 2] * bases[:, :, 0] - functions[:, :, 1] * bases[:, :, 1]) / size
    out[:, :, 0, :, 3:] = functions[:, :, 0] * (surface.cross / surface.area[:, :, None])[:, :, None]
    return out


def _zeros(surface: Surface, count: int) -> Reals:
    m, p, _, n = surface.functions.shape
    return np.zeros((m, p, count, n, 6))


def _arms(surface: Surface) -> Reals:
    """(m, p, 2, n, 3) vectors nᵢ × x,α, so that x,α·d = Σ Nᵢ (nᵢ × x,α)·θᵢ."""
    return np.cross(surface.normals[:, None, None], surface.bases[:, :, :, None])


def _paired(vectors: Reals, slopes: Reals) -> Reals:
    """(m, p, 3, n, 3) rows v_r N,r, v_s N,s and v_r N,s + v_s N,r from vectors (m, p, 2, n or 1, 3)."""
    one, two = vectors[:, :, 0], vectors[:, :, 1]
    r, s = slopes[:, :, 0, :, None], slopes[:, :, 1, :, None]
    return np.stack([one * r, two * s, one * s + two * r], axis=2)


def cartesian_strain(along: Reals) -> Reals:
    """(m, p, 3, 3) from rr, ss, rs to xx, yy, xy; `along` (m, p, 2, 2) are the derivatives of r and s by x and y."""
    (a, b), (c, d) = (along[:, :, i].transpose(2, 0, 1) for i in range(2))
    rows = [[a * a, b * b, a * b], [c * c, d * d, c * d], [2 * a * c, 2 * b * d, a * d + b * c]]
    return np.moveaxis(np.array(rows), (0, 1), (2, 3))


def turned_strain(c: Reals, s: Reals) -> Reals:
    """(m, p, 3, 3) strains xx, yy, xy along axes at the angle with cosine c and sine s (m, p)."""
    rows = [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    return np.moveaxis(np.array(rows), (0, 1), (2, 3))


def bubble_curvature(surface: Surface, bubble: Reals, weights: Reals, axes: Reals, excess: Reals) -> Reals:
    """(m, p, 3, n, 6) curvatures rr, ss, rs of a bubble of the director that takes the integral of `excess` off.

    `bubble` (p, 3) are its values and derivatives along r and s, `weights` (p,) those of the integral, `axes` (m, 2, 3)
    two directions in which it moves, `excess` (m, p, 2, n, 6) the shear that it makes vanish in the mean.
    """
    m, _, _, n, _ = excess.shape
    along = surface.bases @ np.swapaxes(axes, 1, 2)[:, None]
    whole = np.einsum("p,mpak->mak", weights * bubble[:, 0], along)
    missing = np.einsum("p,mpanc->manc", weights, excess).reshape(m, 2, -1)
    moves = -np.linalg.solve(whole, missing)
    (one, two), (r, s) = np.moveaxis(along, 2, 0), bubble[:, 1:].T[:, None, :, None]
    rows = np.stack([one * r, two * s, one * s + two * r], axis=2)
    return np.asarray((rows @ moves[:, None]).reshape(m, -1, 3, n, 6))
