"""Covariant strains of curved shells as rows on (u, θ) of each node, in the basic frame.

The director n is interpolated from the nodes' normals and moves by d = Σ Nᵢ θᵢ × nᵢ. With x the position and u the
displacement, the strain at the height z above the surface is e + z k:

    e_αβ = ½ (x,α·u,β + x,β·u,α),  k_αβ = ½ (x,α·d,β + x,β·d,α + n,α·u,β + n,β·u,α),  γ_α = x,α·d + n·u,α

All of them vanish in rigid motion exactly, whatever x and n are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from femtune.arrays import Reals
from femtune.fem.elements.shells.curved_surface import QUAD8_SHAPE, TRI6_SHAPE, CurvedShape, Surface


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
    """(m, p, 1, n, 6) rotation about the normal relative to that of the surface."""
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
    """(m, p, 3, n, 6) curvatures rr, ss, rs of a bubble of the director that cancels the integral of `excess`.

    `bubble` (p, 3) are its values and derivatives along r and s, `weights` (p,) those of the integral, `axes` (m, 2, 3)
    two directions in which it moves, `excess` (m, p, 2, n, 6) the shear whose mean it cancels.
    """
    m, _, _, n, _ = excess.shape
    along = surface.bases @ np.swapaxes(axes, 1, 2)[:, None]
    whole = np.einsum("p,mpak->mak", weights * bubble[:, 0], along)
    missing = np.einsum("p,mpanc->manc", weights, excess).reshape(m, 2, -1)
    moves = -np.linalg.solve(whole, missing)
    (one, two), (r, s) = np.moveaxis(along, 2, 0), bubble[:, 1:].T[:, None, :, None]
    rows = np.stack([one * r, two * s, one * s + two * r], axis=2)
    return np.asarray((rows @ moves[:, None]).reshape(m, -1, 3, n, 6))


# ----------------------------------------------------------------------------------------------------
# Assumed strains of curved shells: covariant components at tying points, and their interpolation.
#
# Strains that should vanish but cannot with quadratic displacements would lock the shell. So the components along the
# lines of the reference shape are taken at Gauss points of its sides and as means, and are interpolated in a space of
# functions. Sources: Bathe and Dvorkin, Int. J. Numer. Meth. Engng 22 (1986) 697-722 (eight nodes;
# there the strain in the middle is taken at points, here as moments); Neunteufel and Schöberl, Comput. Methods Appl.
# Mech. Engrg 373 (2021) 113524 (membrane strains of triangles); Bathe, Brezzi and Cho, Computers and Structures 32
# (1989) 797-814 (shear of triangles with a bubble of the rotations, whose size is a function of the nodes' motion
# here).


Basis = Callable[[Reals, Reals], list[tuple[Reals | float, ...]]]

GAUSS = 1.0 / np.sqrt(3.0)
"""Point of the two-point Gauss rule on [−1, 1]."""
NEAR = 0.5 - 0.5 * GAUSS
FAR = 0.5 + 0.5 * GAUSS
"""Points of the two-point Gauss rule on [0, 1]."""


@dataclass(frozen=True, eq=False)
class Tie:
    """Values of a strain with c components at k points, and the q functions that take these values.

    Parameters
    ----------
    points : (k, 2)
    functionals : (q, k, c) weights of the components; the weighted sums are the tied values
    basis : (r, s) -> q functions, each with its c components
    """

    points: Reals
    functionals: Reals
    basis: Basis

    def to(self, points: Reals) -> Reals:
        """(p·c, k·c) from all components at the tying points to those at points (p, 2)."""
        flat = self.functionals.reshape(len(self.functionals), -1)
        return np.asarray(self._values(points) @ self._inverse @ flat)

    @cached_property
    def _inverse(self) -> Reals:
        flat = self.functionals.reshape(len(self.functionals), -1)
        return np.asarray(np.linalg.inv(flat @ self._values(self.points)))

    def _values(self, points: Reals) -> Reals:
        """(p·c, q) basis at points."""
        p, c = len(points), self.functionals.shape[2]
        functions = [[np.broadcast_to(part, p) for part in parts] for parts in self.basis(*points.T)]
        return np.asarray(np.moveaxis(np.array(functions), 0, 2).transpose(1, 0, 2).reshape(p * c, -1))


Taken = list[tuple[tuple[float, float], Reals]]
"""Points with the weights of their components: the tied value is the weighted sum."""


def _tie(taken: list[Taken], basis: Basis) -> Tie:
    points = list(dict.fromkeys(point for functional in taken for point, _ in functional))
    functionals = np.zeros((len(taken), len(points), len(taken[0][0][1])))
    for j, functional in enumerate(taken):
        for point, weights in functional:
            functionals[j, points.index(point)] += weights
    return Tie(np.array(points), functionals, basis)


def _at(points: list[tuple[float, float]], *weights: float) -> list[Taken]:
    """The weighted components at each of some points."""
    return [[(point, np.array(weights))] for point in points]


def _moment(shape: CurvedShape, function: Callable[[Reals, Reals], Reals | float], *weights: float) -> Taken:
    """The integral over the reference shape of a function times the weighted components."""
    factors = shape.weights * function(*shape.points.T)
    return [((r, s), f * np.array(weights)) for (r, s), f in zip(shape.points.tolist(), factors)]


def _mean(shape: CurvedShape, *weights: float) -> Taken:
    return _moment(shape, lambda r, s: 1.0, *weights)


_ALONG_R = [(x, y) for x in (-GAUSS, GAUSS) for y in (-1.0, 1.0)]
_ALONG_S = [(x, y) for x in (-1.0, 1.0) for y in (-GAUSS, GAUSS)]
_SIDES = [(NEAR, 0.0), (FAR, 0.0)], [(0.0, NEAR), (0.0, FAR)], [(FAR, NEAR), (NEAR, FAR)]

QUAD_STRAIN = _tie(
    [
        *_at(_ALONG_R, 1, 0, 0),
        *_at(_ALONG_S, 0, 1, 0),
        _mean(QUAD8_SHAPE, 1, 0, 0),
        _mean(QUAD8_SHAPE, 0, 1, 0),
        _mean(QUAD8_SHAPE, 0, 0, 1),
        _moment(QUAD8_SHAPE, lambda r, s: r, 0, 0, 1),
        _moment(QUAD8_SHAPE, lambda r, s: s, 0, 0, 1),
        _moment(QUAD8_SHAPE, lambda r, s: r * s, 0, 0, 1),
    ],
    lambda r, s: [
        *((f, 0, 0) for f in (1, r, s, r * s, s * s)),
        *((0, f, 0) for f in (1, r, s, r * s, r * r)),
        *((0, 0, f) for f in (1, r, s, r * s)),
    ],
)
"""Strains rr, ss and engineering rs of a quadrilateral."""

QUAD_SHEAR = _tie(
    [*_at(_ALONG_R, 1, 0), *_at(_ALONG_S, 0, 1), _mean(QUAD8_SHAPE, 1, 0), _mean(QUAD8_SHAPE, 0, 1)],
    lambda r, s: [*((f, 0) for f in (1, r, s, r * s, s * s)), *((0, f) for f in (1, r, s, r * s, r * r))],
)
"""Transverse shear along r and s of a quadrilateral."""

TRI_STRAIN = _tie(
    [
        *_at(_SIDES[0], 1, 0, 0),
        *_at(_SIDES[1], 0, 1, 0),
        *_at(_SIDES[2], 1, 1, -1),
        _mean(TRI6_SHAPE, 1, 0, 0),
        _mean(TRI6_SHAPE, 0, 1, 0),
        _mean(TRI6_SHAPE, 0, 0, 1),
    ],
    lambda r, s: [
        *((f, 0, 0) for f in (1, r, s)),
        *((0, f, 0) for f in (1, r, s)),
        *((0, 0, f) for f in (1, r, s)),
    ],
)
"""Linear strains of a triangle: equal to those of the displacements along the sides and in the mean (Regge)."""

TRI_SHEAR = _tie(
    [*_at(_SIDES[0], 1, 0), *_at(_SIDES[1], 0, 1), *_at(_SIDES[2], -1, 1)],
    lambda r, s: [*((f, 0) for f in (1, r, s)), *((0, f) for f in (1, r, s))],
)
"""Linear transverse shear of a triangle: equal to that of the displacements along the sides."""
