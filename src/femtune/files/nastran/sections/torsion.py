"""Torsion constants of sections made of straight walls: rectangles, arms, junctions, one closed cell.

A wall of length b and thickness t between two junctions has b t³/3. A free end takes 0.105 t⁴ from it, and a junction
adds a contribution of its square and of the disturbed flow around it (`corner`, `tee`, `crossing`). A closed cell has
J = 4 (∫ψ dA + hole)² / ∮∂ψ/∂n ds plus the torsion constant of its walls alone, where ψ is harmonic between 0 on the
outer contour and 1 on the inner one: Bredt's formula, with a conductance and an area for
each corner.

The torsion constant is at least the sum of those of disjoint parts, because their stress functions together are
admissible for the whole, and at most that of the bounding rectangle. These bounds apply if walls are shorter than
thick.

The constants of junctions were fitted to finite element solutions of Saint-Venant's torsion, for ratios of the two
thicknesses from 1/5 to 5, and from 1/10 to 10 for corners: docs/theory/beam-sections.md. Sources: Roark's Formulas for
Stress and Strain, table 10.7 (rectangle); Timoshenko and Goodier, Theory of Elasticity, chapter 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def ordered(a: Any, b: Any) -> tuple[Any, Any]:
    """The larger and the smaller of two numbers or jets, entry by entry where they have several entries."""
    first = getattr(a, "value", a).real >= getattr(b, "value", b).real
    if not np.ndim(first):
        return (a, b) if first else (b, a)
    of_first = np.asarray(first, dtype=float)
    return a * of_first + b * (1.0 - of_first), b * of_first + a * (1.0 - of_first)


def larger(a: Any, b: Any) -> Any:
    """The larger of two numbers or jets, entry by entry."""
    return ordered(a, b)[0]


def rectangle_torsion(w: Any, h: Any) -> Any:
    """Torsion constant of a solid rectangle, a b³ (1/3 − 0.21 b/a (1 − b⁴/12a⁴)) with a ≥ b (Roark, table 10.7)."""
    a, b = ordered(w, h)
    return a * b**3 * (1 / 3 - 0.21 * b / a * (1.0 - b**4 / (12.0 * a**4)))


def wall(length: Any, t: Any) -> Any:
    """A wall between two junctions."""
    return length * t**3 / 3.0


def arm(length: Any, t: Any) -> Any:
    """A wall from a junction to its free end: half of a rectangle of twice the length."""
    return rectangle_torsion(2.0 * length, t) / 2.0


def corner(s: Any, t: Any) -> Any:
    """Corner of two walls of thickness s and t; their lengths are measured from the inner corner."""
    product, square = s * t, (s - t) ** 2
    return 0.4032 * product**2 - 0.0847 * product * square - 0.1065 * square**2


def tee(web: Any, t: Any) -> Any:
    """Junction of a web with a wall of thickness t that continues on both sides of it."""
    fitted = 0.3343 * web * t - 0.0533 * t**2 + 0.2271 * t**3 / (web + t)
    return web * t**3 / 3.0 - 0.105 * web**4 + web**2 * fitted


def crossing(s: Any, t: Any) -> Any:
    """Crossing of two walls of thickness s and t."""
    return 0.3398 * (s * t) ** 2 + 0.3305 * s * t * (s**2 + t**2)


def box_torsion(inner_w: Any, inner_h: Any, low: Any, high: Any, left: Any, right: Any) -> Any:
    """Torsion constant of a box from the width and height of its hole and the thicknesses of its walls.

    Bredt's formula without corners, which gives less, is used if the walls at a corner differ too much.
    """
    w, h = inner_w + (left + right) / 2.0, inner_h + (low + high) / 2.0
    bredt = 4.0 * (w * h) ** 2 / (w / low + w / high + h / left + h / right)
    conductance = inner_w / low + inner_w / high + inner_h / left + inner_h / right
    area = inner_w * inner_h + (inner_w * (low + high) + inner_h * (left + right)) / 2.0
    walls = wall(inner_w, low) + wall(inner_w, high) + wall(inner_h, left) + wall(inner_h, right)
    for s, t in ((low, left), (low, right), (high, left), (high, right)):
        q = (s - t) ** 2 / (s * t)
        conductance = conductance + _ratio(q, (0.5588, 0.3149, 0.02152), (1.0, 0.23874, 0.00757))
        area = area + s * t * _ratio(q, (0.1449, -0.08227, -0.03361), (1.0, 0.24846))
        walls = walls + corner(s, t)
    return larger(4.0 * area**2 / conductance + walls, bredt)


def _ratio(q: Any, numerator: Sequence[float], denominator: Sequence[float]) -> Any:
    above, below = (sum(c * q**k for k, c in enumerate(part) if k) + part[0] for part in (numerator, denominator))
    return above / below
