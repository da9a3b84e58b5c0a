"""Torsion, shear and shear centre of a section of rectangles by finite elements of its warping: the reference.

Bilinear elements on a grid whose lines follow the rectangles' edges. Saint-Venant's torsion: ∇²ω = 0 with
∂ω/∂n = z n_y − y n_z; shear at ν = 0: τ = ∇φ with ∇²φ = −(b·r), where b is the bending direction over the moments of
inertia (Cowper 1966 with ν = 0; Pilkey, Analysis and Design of Elastic Beams, 2002, chapters 5 and 6).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Box = tuple[float, float, float, float]
_GAUSS = np.array([-1.0, 1.0]) / np.sqrt(3.0)


@dataclass(frozen=True)
class Solved:
    """Numerical properties; y and z of the shear centre seen from the centroid."""

    A: float
    I1: float
    I2: float
    I12: float
    J: float
    K1: float
    K2: float
    shear_centre: tuple[float, float]


def solve_section(boxes: list[Box], size: float) -> Solved:
    """Properties of a union of rectangles (y from, y to, z from, z to) with elements no larger than `size`."""
    y, z = (_lines([b[k] for b in boxes] + [b[k + 1] for b in boxes], size) for k in (0, 2))
    cells = _cells(boxes, y, z)
    nodes, conn = np.unique(_corners(cells, len(z)), return_inverse=True)
    xy = np.column_stack([y[nodes // len(z)], z[nodes % len(z)]])
    return _properties(xy, conn.reshape(-1, 4))


def _lines(edges: list[float], size: float) -> Reals:
    marks = np.unique(np.round(edges, 12))
    pieces = [np.linspace(a, b, max(2, int(np.ceil((b - a) / size))) + 1)[:-1] for a, b in pairwise(marks)]
    return np.concatenate([*pieces, marks[-1:]])


def _cells(boxes: list[Box], y: Reals, z: Reals) -> NDArray[np.int64]:
    ym, zm = (y[1:] + y[:-1]) / 2, (z[1:] + z[:-1]) / 2
    inside = np.zeros((len(ym), len(zm)), bool)
    for y0, y1, z0, z1 in boxes:
        inside |= ((ym > y0) & (ym < y1))[:, None] & ((zm > z0) & (zm < z1))
    return np.argwhere(inside)


def _corners(cells: NDArray[np.int64], nz: int) -> NDArray[np.int64]:
    i, j = cells[:, 0], cells[:, 1]
    return np.column_stack([i * nz + j, (i + 1) * nz + j, (i + 1) * nz + j + 1, i * nz + j + 1])


def _properties(xy: Reals, conn: NDArray[np.int64]) -> Solved:
    n, points = len(xy), _integration(xy, conn)
    weight = sum(w for _, _, _, w in points)
    A = float(weight.sum())
    centre = sum((N @ xy[conn]) * w[:, None] for N, _, _, w in points).sum(0) / A
    xy = xy - centre
    r = [np.einsum("a,eak->ek", N, xy[conn]) for N, _, _, _ in points]
    I1, I2, I12 = (
        sum(float((p[:, a] * p[:, b] * q[3]).sum()) for p, q in zip(r, points)) for a, b in ((0, 0), (1, 1), (0, 1))
    )
    K = _assemble(conn, sum(w[:, None, None] * (dy[:, :, None] * dy[:, None] + dz[:, :, None] * dz[:, None])
                            for _, dy, dz, w in points), n)  # fmt: skip
    solve = spla.splu(K[1:, 1:].tocsc())

    def solution(load: Reals) -> Reals:
        return np.concatenate([[0.0], solve.solve(load[1:])])

    # torsion: shear strains (∂ω/∂y − z, ∂ω/∂z + y)
    load = _scatter(conn, sum(w[:, None] * (p[:, 1:] * dy - p[:, :1] * dz) for p, (_, dy, dz, w) in zip(r, points)), n)
    omega = solution(load)
    J = I1 + I2 - float(load @ omega)
    # a shear along y or z bends by b·r, b = inverse of the moments of inertia
    inverse = np.linalg.inv([[I1, I12], [I12, I2]])
    factors, moments = [], []
    for b in inverse:
        load = _scatter(conn, sum(w[:, None] * N * (p @ b)[:, None] for p, (N, _, _, w) in zip(r, points)), n)
        phi = solution(load)
        factors.append(1.0 / (A * float(load @ phi)))
        # moment of the shear stress ∇φ about the centroid, y τz − z τy
        stress = [((dy * phi[conn]).sum(1), (dz * phi[conn]).sum(1)) for _, dy, dz, _ in points]
        moments.append(sum(float(((p[:, 0] * tz - p[:, 1] * ty) * q[3]).sum())
                           for p, (ty, tz), q in zip(r, stress, points)))  # fmt: skip
    return Solved(A, I1, I2, I12, J, *factors, (moments[1], -moments[0]))


def _integration(xy: Reals, conn: NDArray[np.int64]) -> list[tuple[Reals, Reals, Reals, Reals]]:
    """Shape functions (4,), their derivatives by y and z (e, 4) and weights (e,) at each Gauss point."""
    low, high = xy[conn[:, 0]], xy[conn[:, 2]]
    hy, hz = (high - low).T
    out = []
    for s in _GAUSS:
        for t in _GAUSS:
            N = np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)]) / 4
            dy = np.array([-(1 - t), 1 - t, 1 + t, -(1 + t)]) / 2 / hy[:, None]
            dz = np.array([-(1 - s), -(1 + s), 1 + s, 1 - s]) / 2 / hz[:, None]
            out.append((N, dy, dz, hy * hz / 4))
    return out


def _assemble(conn: NDArray[np.int64], k: Reals, n: int) -> sp.csr_array:
    rows, columns = np.repeat(conn, 4, axis=1), np.tile(conn, (1, 4))
    return sp.csr_array((k.reshape(len(conn), -1).ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))


def _scatter(conn: NDArray[np.int64], f: Reals, n: int) -> Reals:
    return np.bincount(conn.ravel(), f.ravel(), minlength=n)
