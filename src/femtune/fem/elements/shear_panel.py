"""Shear panels (CSHEAR): a thin web with tangential edge loads, and rods on the edges for direct stress.

The web's stress is the field in equilibrium with purely tangential edge loads. Each convex quadrilateral has one:
statics is invariant under projections, so it is the image of the square in uniform shear, whose Airy function u v
becomes u v / s with linear functions u, v, s that the sides give (u = ±s and v = ±s on opposite sides). It is Garvey's
field (Aircraft Engineering 23, 1951, 134): uniform in a parallelogram, falling with the square of the distance from a
trapezoid's apex. With the complementary energy q² (A_E / E + A_G / G) / 2t of a flow q, and the work C of the edge
loads on edges that stretch uniformly, the stiffness is C Cᵀ t / (A_E / E + A_G / G).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import ErrorCollector
from femtune.fem.contribution import Contribution, product
from femtune.fem.elements.kind import ElementKind
from femtune.fem.elements.placement import nominal
from femtune.fem.elements.shells.checks import check_shapes, check_thickness
from femtune.fem.elements.shells.placement import mean_plane
from femtune.fem.elements.shells.quad import determinant, functions, quad_shares, slopes
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

LARGEST_EFFECTIVENESS = 1.01
"""Value of F1 or F2 above which it is a width in thicknesses, so that each edge has a rod of area F t² / 2.

As in Nastran (PSHEAR in the MSC Nastran Quick Reference Guide); up to it F is a fraction of the web's area.
"""
_RECTANGLE_ENERGY = 1e-12
"""Ratio of the complementary energies of direct and shear stress up to which the web is a rectangle.

The ratio is quadratic in the angle by which a side is off, so the angle is 1e-6: the rounding of coordinates.
"""
# 6 × 6 Gauss points: exact for parallelograms, whose stress is uniform; of trapezoids the integrand is rational
_GAUSS_POINTS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(6)
_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
# edges of F1 and of F2
_PAIRS = {"F1": (0, 2), "F2": (1, 3)}


class Web(NamedTuple):
    """Loads of unit flow at the corners (m, 4, 2) on the mean plane, and the integrals A_E and A_G, (m,)."""

    loads: Reals
    direct: Reals
    shear: Reals


def shear_panel(batch: ElementBatch, structure: Structure) -> list[Contribution]:
    """Stiffness of web and edges, and mass, of shear panels.

    Raises
    ------
    FemtuneError : ``element.shell-shape``, ``element.shell-thickness``
    """
    xyz = structure.nodes.xyz[batch.nodes]
    _check(batch, structure, xyz)
    axes, corners, heights = mean_plane(xyz)
    turn = _to_axes(structure.nodes.frames[batch.nodes], axes)
    return [
        *_web_terms(web_field(corners), corners, heights, turn),
        *_edge_terms(batch, structure, xyz, 0.5 * _twice_area(corners)),
        *_mass_terms(batch, structure, corners),
    ]


def _check(batch: ElementBatch, structure: Structure, xyz: Reals) -> None:
    collector = ErrorCollector()
    check_thickness(batch, structure, collector)
    check_shapes(batch, xyz, collector)
    collector.raise_if_any()


def _to_axes(frames: Reals, axes: Reals) -> Reals:
    """(e, 4, 3, 3) from displacements of the corners, in their frames, to the axes of the mean plane."""
    return np.asarray(np.swapaxes(axes, 1, 2)[:, None] @ frames)


def _twice_area(corners: Reals) -> Reals:
    one, other = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _web_terms(web: Web, corners: Reals, heights: Reals, turn: Reals) -> list[Contribution]:
    loads = np.einsum("eia,eiab->eib", _with_normal(web.loads, corners, heights), turn).reshape(len(corners), 12)
    ratio = web.direct / web.shear
    matrices = loads[:, :, None] * loads[:, None, :] / web.shear[:, None, None]
    out = []
    for label, at in (("web", ratio <= _RECTANGLE_ENERGY), ("oblique web", ratio > _RECTANGLE_ENERGY)):
        group = np.flatnonzero(at)
        if group.size and label == "web":
            out.append(Contribution("stiffness", label, group, matrices[group], ("G", "t"), product("G", "t")))
        elif group.size:
            facts = {"ratio": ratio[group]}
            out.append(Contribution("stiffness", label, group, matrices[group], ("E", "G", "t"), oblique, facts))
    return out


def oblique(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
    """G t / (1 + r G / E): an oblique web is softer because its shear flow causes direct stresses."""
    shear = values["G"]
    return shear * values["t"] / (1.0 + facts["ratio"] * shear / values["E"])


def _with_normal(loads: Reals, corners: Reals, heights: Reals) -> Reals:
    """(e, 4, 3) loads with the smallest forces along the normal that keep a warped web in equilibrium."""
    ones = np.ones(corners.shape[:2])
    balance = np.stack([ones, corners[:, :, 0], corners[:, :, 1]], axis=1)
    need = np.zeros((len(corners), 3))
    need[:, 1:] = np.einsum("ei,eia->ea", heights, loads)
    normal = np.linalg.pinv(balance) @ need[:, :, None]
    return np.concatenate([loads, normal], axis=2)


def web_field(corners: Reals) -> Web:
    """Edge loads and complementary energy of a unit flow in quadrilaterals with corners (m, 4, 2)."""
    lines = field_functions(corners)
    direct, shear = np.zeros((2, len(corners)))
    for xi, a in zip(_GAUSS_POINTS, _GAUSS_WEIGHTS):
        for eta, b in zip(_GAUSS_POINTS, _GAUSS_WEIGHTS):
            area = a * b * determinant(slopes((xi, eta)) @ corners)
            nx, ny, nxy = flow(lines, functions((xi, eta)) @ corners)
            direct += area * (nx + ny) ** 2
            shear += area * (nxy**2 - nx * ny)
    return Web(_edge_loads(lines, corners), direct, shear)


def field_functions(corners: Reals) -> Reals:
    """(m, 3, 3) coefficients of u, v and s in 1, x, y, with s one at the centre."""
    sides = np.stack([_line(corners[:, i], corners[:, j]) for i, j in _EDGES], axis=1)
    # s is the sum of the functions of either pair of opposite sides; its values at the corners fix their factors
    t123, t134, t124, t234 = (_triangle(corners, *k) for k in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)))
    right, left = t134 / t123, t234 / t124
    bottom = left * t134 / t123
    down, east, up, west = np.moveaxis(sides, 1, 0)
    east, west, down = east * right[:, None], west * left[:, None], down * bottom[:, None]
    out = 0.5 * np.stack([west - east, down - up, west + east], axis=1)
    centre = corners.mean(axis=1)
    size = out[:, 2, 0] + np.einsum("ma,ma->m", out[:, 2, 1:], centre)
    return np.asarray(out / size[:, None, None])


def _line(a: Reals, b: Reals) -> Reals:
    """(m, 3) linear function in 1, x, y that is zero on the line from a to b and positive on its left."""
    along = b - a
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return np.concatenate([-np.einsum("ma,ma->m", normal, a)[:, None], normal], axis=1)


def _triangle(corners: Reals, i: int, j: int, k: int) -> Reals:
    one, other = corners[:, j] - corners[:, i], corners[:, k] - corners[:, i]
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def flow(lines: Reals, at: Reals) -> tuple[Reals, Reals, Reals]:
    """nx, ny and nxy, second derivatives of the Airy function −u v / s at points (m, 2)."""
    u, v, s = (lines[:, k, 0] + np.einsum("ma,ma->m", lines[:, k, 1:], at) for k in range(3))
    du, dv, ds = (lines[:, k, 1:] for k in range(3))

    def second(i: int, j: int) -> Reals:
        uv = du[:, i] * dv[:, j] + dv[:, i] * du[:, j]
        us = du[:, i] * ds[:, j] + ds[:, i] * du[:, j]
        vs = dv[:, i] * ds[:, j] + ds[:, i] * dv[:, j]
        return np.asarray(uv / s - (v * us + u * vs) / s**2 + 2.0 * u * v * ds[:, i] * ds[:, j] / s**3)

    return -second(1, 1), -second(0, 0), second(0, 1)


def _edge_loads(lines: Reals, corners: Reals) -> Reals:
    """(m, 4, 2) work of the edge loads on displacements that are linear along each edge."""
    out = np.zeros_like(corners)
    for i, j in _EDGES:
        along = corners[:, j] - corners[:, i]
        for x, weight in zip(0.5 * (1.0 + _GAUSS_POINTS), 0.5 * _GAUSS_WEIGHTS):
            nx, ny, nxy = flow(lines, corners[:, i] + x * along)
            outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
            load = np.stack(
                [nx * outward[:, 0] + nxy * outward[:, 1], nxy * outward[:, 0] + ny * outward[:, 1]], axis=1
            )
            out[:, i] += weight * (1.0 - x) * load
            out[:, j] += weight * x * load
    return out


def _edge_terms(batch: ElementBatch, structure: Structure, xyz: Reals, area: Reals) -> list[Contribution]:
    """Rods of area F t A / (L + L') on two opposite edges, or F t² / 2 for F above `LARGEST_EFFECTIVENESS`."""
    length = np.linalg.norm(np.roll(xyz, -1, axis=1) - xyz, axis=2)
    rods = [_rod(structure, batch, xyz, length, k) for k in range(4)]
    out = []
    for name, (one, other) in _PAIRS.items():
        wide = nominal(batch, structure, name) > LARGEST_EFFECTIVENESS
        pair = rods[one] + rods[other]
        shared = pair * (area / (length[:, one] + length[:, other]))[:, None, None]
        for label, at, matrices, roles in (
            ("effective", ~wide, shared, ("E", name, "t")),
            ("effective width", wide, 0.5 * pair, ("E", name, "t", "t")),
        ):
            group = np.flatnonzero(at)
            if group.size:
                names = tuple(dict.fromkeys(roles))
                out.append(Contribution("stiffness", f"{label} {name}", group, matrices[group], names, product(*roles)))
    return out


def _rod(structure: Structure, batch: ElementBatch, xyz: Reals, length: Reals, k: int) -> Reals:
    """(e, 12, 12) stiffness of a rod of unit area and modulus on an edge."""
    i, j = _EDGES[k]
    along = (xyz[:, j] - xyz[:, i]) / length[:, k, None]
    g = np.zeros((len(xyz), 4, 3))
    for corner, sign in ((i, -1.0), (j, 1.0)):
        g[:, corner] = sign * np.einsum("ea,eab->eb", along, structure.nodes.frames[batch.nodes[:, corner]])
    flat = g.reshape(len(xyz), 12)
    return np.asarray(flat[:, :, None] * flat[:, None, :] / length[:, k, None, None])


def _mass_terms(batch: ElementBatch, structure: Structure, corners: Reals) -> list[Contribution]:
    """ρ t and NSM, consistent for bilinear displacements or lumped at the corners."""
    shares = quad_shares(corners) * structure.mass_factor
    if not structure.consistent_mass:
        shares = shares.sum(axis=2)[:, :, None] * np.eye(4)
    frames = structure.nodes.frames[batch.nodes]
    matrix = np.einsum("eij,eica,ejcb->eiajb", shares, frames, frames).reshape(len(corners), 12, 12)
    matrix = 0.5 * (matrix + np.swapaxes(matrix, 1, 2))
    at = np.arange(len(batch))
    return [
        Contribution("mass", "mass", at, matrix, ("rho", "t"), product("rho", "t")),
        Contribution("mass", "added-mass", at, matrix, ("NSM",), product("NSM")),
    ]


SHEAR_PANEL = ElementKind("shear-panel", shear_panel, faces=((0, 1, 2, 3),))
