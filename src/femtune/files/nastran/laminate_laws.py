"""Stiffness of laminates from their plies: functions of the value table's jets, with exact derivatives.

A ply has the thickness t, the height c of its middle above the laminate's middle, and a law in the laminate's axes. The
transverse shear is that of Nastran (equilibrium of cylindrical bending): with σ = E (z − n) κ of each direction, n its
neutral axis, the first moment f(z) = −∫ E (z' − n) dz' from the bottom gives τ = f/EI · V, and the flexibilities are
∫ fᵢ fⱼ (G⁻¹)ᵢⱼ dz / EIᵢ EIⱼ. For a single material this is 5/6 G h.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from femtune.fem.rules import makes_rules
from femtune.parameters import jet

Rule = Callable[..., Any]
_DEGREE = np.pi / 180.0


def total(parts: Iterable[Any]) -> Any:
    """Sum of one or more jets."""
    first, *others = parts
    for other in others:
        first = first + other
    return first


def thickness(*plies: Any) -> Any:
    """h = Σ t."""
    return total(plies)


@cache
@makes_rules
def middle_height(k: int) -> Rule:
    """Height of the middle of ply k above the middle of the laminate, from the thicknesses of all plies."""

    def height(*plies: Any) -> Any:
        none = 0.0 * plies[k]
        return (total([none, *plies[:k]]) - total([none, *plies[k + 1 :]])) * 0.5

    return height


def middle_offset(bottom: Any, height: Any) -> Any:
    """Height of the laminate's middle above the reference plane: Z0 + h/2."""
    return bottom + height * 0.5


# --- one ply in the laminate's axes -----------------------------------------------------------------------------------

_PLACES = {"11": (0, 0), "12": (0, 1), "13": (0, 2), "22": (1, 1), "23": (1, 2), "33": (2, 2)}


def _turn(theta: Any) -> list[list[Any]]:
    """Strains along the ply's axes from those along the laminate's; θ in degrees."""
    c, s = jet.cos(theta * _DEGREE), jet.sin(theta * _DEGREE)
    cc, ss, cs = c * c, s * s, c * s
    return [[cc, ss, cs], [ss, cc, -cs], [-2.0 * cs, 2.0 * cs, cc - ss]]


@cache
@makes_rules
def turned_stiffness(entry: str) -> Rule:
    """Entry of Q̄ = TᵀQT from the six entries of Q and θ in degrees."""
    i, j = _PLACES[entry]

    def stiffness(*values: Any) -> Any:
        *law, theta = values
        a, b, c, d, e, f = law
        Q, T = [[a, b, c], [b, d, e], [c, e, f]], _turn(theta)
        return total(T[p][i] * Q[p][q] * T[q][j] for p in range(3) for q in range(3))

    return stiffness


@cache
@makes_rules
def turned_modulus(direction: int) -> Rule:
    """Modulus along x (0) or y (1) as in Nastran: of the rotated Q with zero Poisson's ratios."""

    def modulus(a: Any, b: Any, d: Any, f: Any, theta: Any) -> Any:
        T = _turn(theta)
        one, two = a - b * b / d, d - b * b / a
        x, y, xy = (T[p][direction] for p in range(3))
        return one * x * x + two * y * y + f * xy * xy

    return modulus


def plain_modulus(a: Any, b: Any, d: Any) -> Any:
    """Uniaxial modulus of a law along its first axis."""
    return a - b * b / d


@cache
@makes_rules
def turned_flexibility(entry: str) -> Rule:
    """Entry 11, 12 or 22 of the inverse of a transverse shear law, turned by θ in degrees."""

    def flexibility(a: Any, b: Any, d: Any, theta: Any) -> Any:
        c, s = jet.cos(theta * _DEGREE), jet.sin(theta * _DEGREE)
        one, both, two = shear_inverse("11")(a, b, d), shear_inverse("12")(a, b, d), shear_inverse("22")(a, b, d)
        if entry == "12":
            return c * s * (one - two) + (c * c - s * s) * both
        sign, (x, y) = (1.0, (c, s)) if entry == "22" else (-1.0, (s, c))
        return x * x * two + y * y * one + sign * 2.0 * c * s * both

    return flexibility


@cache
@makes_rules
def shear_inverse(entry: str) -> Rule:
    """Entry of the inverse of a positive definite 2 × 2 matrix given by 11, 12 and 22.

    By elimination of one row: the determinant of the flexibility of very stiff sheets could underflow.
    """

    def inverse(a: Any, b: Any, d: Any) -> Any:
        if entry == "11":
            return 1.0 / (a - b * (b / d))
        rest = 1.0 / (d - b * (b / a))
        return rest if entry == "22" else -(b / a) * rest

    return inverse


# --- sums over the plies ----------------------------------------------------------------------------------------------


def _split(values: Sequence[Any], kinds: int) -> list[Sequence[Any]]:
    n = len(values) // kinds
    return [values[k * n : (k + 1) * n] for k in range(kinds)]


def membrane_sum(*values: Any) -> Any:
    """A = Σ Q̄ t from all Q̄ and all t; also the mass, Σ ρ t."""
    Q, t = _split(values, 2)
    return total(q * h for q, h in zip(Q, t))


def coupling_sum(*values: Any) -> Any:
    """B = Σ Q̄ t c."""
    Q, t, c = _split(values, 3)
    return total(q * h * z for q, h, z in zip(Q, t, c))


def bending_sum(*values: Any) -> Any:
    """12 D = Σ Q̄ (t³ + 12 t c²)."""
    Q, t, c = _split(values, 3)
    return total(q * h * (h * h + 12.0 * (z * z)) for q, h, z in zip(Q, t, c))


def smeared_bending(membrane: Any, height: Any) -> Any:
    """12 D = A h² of a laminate whose stacking sequence is ignored."""
    return membrane * height * height


def cored_bending(*values: Any) -> Any:
    """12 D of a core (the last Q̄ and t) between faces that each have half of all other plies, in any order."""
    Q, t = _split(values, 2)
    faces = total(t[:-1])
    mean, core, whole = membrane_sum(*Q[:-1], *t[:-1]) / faces, t[-1], t[-1] + faces
    cube = core * core * core
    return Q[-1] * cube + mean * (whole * whole * whole - cube)


class _Direction(NamedTuple):
    """One direction of cylindrical bending: f = a + b s + c s² in each ply, s from its middle; and EI."""

    a: list[Any]
    b: list[Any]
    c: list[Any]
    bending: Any


def _direction(E: Sequence[Any], t: Sequence[Any], z: Sequence[Any]) -> _Direction:
    axial = total(e * h for e, h in zip(E, t))
    neutral = total(e * h * x for e, h, x in zip(E, t, z)) / axial
    arms = [neutral - x for x in z]
    bending = total(e * h * (h * h / 12.0 + x * x) for e, h, x in zip(E, t, arms))
    a, below = [], 0.0 * axial
    for e, h, x in zip(E, t, arms):
        whole = e * h * x
        a.append(below + 0.5 * whole + e * h * h / 8.0)
        below = below + whole
    return _Direction(a, [e * x for e, x in zip(E, arms)], [-0.5 * e for e in E], bending)


def _flexibility(one: _Direction, two: _Direction, H: Sequence[Any], t: Sequence[Any]) -> Any:
    parts = []
    for k, h in enumerate(t):
        hh = h * h / 12.0
        squares = one.a[k] * two.a[k] + hh * (one.a[k] * two.c[k] + one.c[k] * two.a[k] + one.b[k] * two.b[k])
        parts.append(h * (squares + one.c[k] * two.c[k] * (h * h * h * h / 80.0)) * H[k])
    return total(parts) / (one.bending * two.bending)


def shear_flexibility(*values: Any) -> Any:
    """Flexibility of transverse shear in one direction, from all E, 1/G, t and c."""
    E, H, t, z = _split(values, 4)
    one = _direction(E, t, z)
    return _flexibility(one, one, H, t)


def shear_flexibility_between(*values: Any) -> Any:
    """Flexibility of transverse shear between the two directions, from all Ex, Ey, (G⁻¹)xy, t and c."""
    Ex, Ey, H, t, z = _split(values, 5)
    return _flexibility(_direction(Ex, t, z), _direction(Ey, t, z), H, t)


def reciprocal(value: Any) -> Any:
    """1/x."""
    return 1.0 / value
