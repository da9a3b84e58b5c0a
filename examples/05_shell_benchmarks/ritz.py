"""Rectangular and skew plates by the Ritz method with Legendre polynomials: a reference without femtune.

Edges are named in the order of Leissa (1973): u = 0, v = 0, u = 1, v = 1; S simply supported, C clamped, F free.
Frequencies are ω L² √(ρt/D).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.linalg import eigh

Reals = NDArray[np.float64]
Operator = dict[tuple[int, int], float]
KAPPA = 5.0 / 6.0


def supports() -> list[str]:
    """The 21 different combinations of edges of a square plate."""
    found = set()
    for letters in product("SCF", repeat=4):
        edges = "".join(letters)
        turned = [edges[i:] + edges[:i] for i in range(4)]
        found.add(max(turned + [e[::-1] for e in turned]))
    return sorted(found, reverse=True)


def basis(start: int, end: int, count: int) -> tuple[Reals, Reals]:
    """Orthonormal polynomials on (0, 1) with zeros of the given order at its ends: values of the derivatives 0, 1, 2.

    Returns (3, points, count) and the weights of the points.
    """
    x, weights = legendre.leggauss(count + 6)
    edge = np.array([1.0])
    for root, times in ((1.0, start), (-1.0, end)):
        for _ in range(times):
            edge = legendre.legmul(edge, np.array([1.0, root]))
    series = [legendre.legmul(edge, np.eye(count)[k]) for k in range(count)]
    values = np.array(
        [[2.0**p * legendre.legval(x, legendre.legder(s, p)) for s in series] for p in range(3)]
    ).transpose(0, 2, 1)
    triangle = np.linalg.qr(np.sqrt(weights / 2)[:, None] * values[0])[1]
    return values @ np.linalg.inv(triangle), weights / 2


def form(one: Operator, two: Operator, left: tuple[Reals, ...], right: tuple[Reals, ...], weights: Reals) -> Reals:
    """∫ (one of the left field) (two of the right field), each field the product of a basis in u and one in v."""
    total: Reals = np.zeros((1, 1))
    for (p, q), a in one.items():
        for (r, s), b in two.items():
            u = (left[0][p] * weights[:, None]).T @ right[0][r]
            v = (left[1][q] * weights[:, None]).T @ right[1][s]
            total = total + a * b * np.kron(u, v)
    return total


def thin(edges: str, count: int, skew: float = 0.0, nu: float = 0.3, terms: int = 16) -> Reals:
    """The lowest `count` numbers of Kirchhoff's plate with unit sides, leaning by `skew` in radians."""
    order = {"F": 0, "S": 1, "C": 2}
    (u, weights), (v, _) = (basis(order[edges[i]], order[edges[i + 2]], terms) for i in (0, 1))
    s, c = np.sin(skew), np.cos(skew)
    xx: Operator = {(2, 0): 1.0}
    yy: Operator = {(0, 2): 1 / c**2, (1, 1): -2 * s / c**2, (2, 0): s**2 / c**2}
    xy: Operator = {(1, 1): 1 / c, (2, 0): -s / c}
    parts = ((xx, xx, 1.0), (yy, yy, 1.0), (xx, yy, nu), (yy, xx, nu), (xy, xy, 2 - 2 * nu))
    K = sum(factor * form(one, two, (u, v), (u, v), weights) for one, two, factor in parts)
    return np.asarray(np.sqrt(np.abs(eigh(K, eigvals_only=True)[:count])))


def turning(edges: str, across: int | None, terms: int) -> tuple[Reals, ...]:
    """Bases in u and v of a turn about the other axis (0, 1), or of the deflection (None)."""
    orders = [[int(edges[i + k] in ("C" if i == across else "SC")) for k in (0, 2)] for i in (0, 1)]
    return tuple(basis(*order, terms)[0] for order in orders)


def thick(edges: str, count: int, t: float, nu: float = 0.3, terms: int = 14) -> Reals:
    """The same of Mindlin's square plate without rotary inertia, edges S holding the turn about their normal."""
    weights = basis(0, 0, terms)[1]
    w, a, b = (turning(edges, across, terms) for across in (None, 0, 1))
    none, du, dv = {(0, 0): 1.0}, {(1, 0): 1.0}, {(0, 1): 1.0}
    shear, half = 6.0 * KAPPA * (1.0 - nu) / t**2, (1.0 - nu) / 2.0
    aa = form(du, du, a, a, weights) + half * form(dv, dv, a, a, weights) + shear * form(none, none, a, a, weights)
    bb = form(dv, dv, b, b, weights) + half * form(du, du, b, b, weights) + shear * form(none, none, b, b, weights)
    ab = nu * form(du, dv, a, b, weights) + half * form(dv, du, a, b, weights)
    turns = np.block([[aa, ab], [ab.T, bb]])
    mixed = shear * np.hstack([form(du, none, w, a, weights), form(dv, none, w, b, weights)])
    sheared = shear * (form(du, du, w, w, weights) + form(dv, dv, w, w, weights))
    K = sheared - mixed @ np.linalg.solve(turns, mixed.T)
    return np.asarray(np.sqrt(np.abs(eigh(0.5 * (K + K.T), eigvals_only=True)[:count])))


def membrane(count: int, skew: float = 0.0, terms: int = 24) -> Reals:
    """The lowest eigenvalues of −Δ on the rhombus, zero at its edges.

    They are the numbers of the simply supported thin plate, as for every convex polygon, and lack its strong
    singularities in obtuse corners.
    """
    f, weights = basis(1, 1, terms)
    s, c = np.sin(skew), np.cos(skew)
    x: Operator = {(1, 0): 1.0}
    y: Operator = {(0, 1): 1 / c, (1, 0): -s / c}
    K = form(x, x, (f, f), (f, f), weights) + form(y, y, (f, f), (f, f), weights)
    return np.asarray(eigh(K, eigvals_only=True)[:count])
