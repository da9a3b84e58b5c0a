"""Cross sections of PBARL and PBEAML: area, moments of inertia and shear factors as functions of the dimensions.

Plane 1 is the plane of the element's x and y axes; I1 is the moment of inertia for bending in it.

Shear factors: 0.9 for a rod reproduces frequencies that commercial Nastran lists, to six digits. Those of the other
sections are the usual ones (5/6 for a rectangle, 1/2 for a thin tube, the webs' share of the area for a box).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

SECTION_ROLES = ("A", "I1", "I2", "J", "K1", "K2")
Formula = Callable[..., Any]


@dataclass(frozen=True)
class Shape:
    """A section with `n` dimensions; each formula takes the dimensions (jets or numbers)."""

    n: int
    formulas: Mapping[str, Formula]
    valid: Callable[..., bool]
    rule: str

    @property
    def dimensions(self) -> tuple[str, ...]:
        """DIM1 … DIMn."""
        return tuple(f"DIM{i + 1}" for i in range(self.n))


def _rod() -> Shape:
    return Shape(
        1,
        {
            "A": lambda r: math.pi * r**2,
            "I1": lambda r: math.pi / 4 * r**4,
            "I2": lambda r: math.pi / 4 * r**4,
            "J": lambda r: math.pi / 2 * r**4,
            "K1": lambda r: 0.9 + 0.0 * r,
            "K2": lambda r: 0.9 + 0.0 * r,
        },
        lambda r: r > 0,
        "the radius DIM1 should be positive",
    )


def _tube() -> Shape:
    return Shape(
        2,
        {
            "A": lambda r, s: math.pi * (r**2 - s**2),
            "I1": lambda r, s: math.pi / 4 * (r**4 - s**4),
            "I2": lambda r, s: math.pi / 4 * (r**4 - s**4),
            "J": lambda r, s: math.pi / 2 * (r**4 - s**4),
            "K1": lambda r, s: 0.5 + 0.0 * r,
            "K2": lambda r, s: 0.5 + 0.0 * r,
        },
        lambda r, s: r > s >= 0,
        "the outer radius DIM1 should be greater than the inner radius DIM2",
    )


def _bar() -> Shape:
    return Shape(
        2,
        {
            "A": lambda w, h: w * h,
            "I1": lambda w, h: w * h**3 / 12,
            "I2": lambda w, h: h * w**3 / 12,
            "J": rectangle_torsion,
            "K1": lambda w, h: 5 / 6 + 0.0 * w,
            "K2": lambda w, h: 5 / 6 + 0.0 * w,
        },
        lambda w, h: w > 0 and h > 0,
        "width DIM1 and height DIM2 should be positive",
    )


def rectangle_torsion(w: Any, h: Any) -> Any:
    """Torsion constant of a solid rectangle, a b³ (1/3 − 0.21 b/a (1 − b⁴/12a⁴)) with a ≥ b (Roark, table 10.7)."""
    wide = getattr(w, "value", w).real >= getattr(h, "value", h).real
    a, b = (w, h) if wide else (h, w)
    return a * b**3 * (1 / 3 - 0.21 * b / a * (1.0 - b**4 / (12.0 * a**4)))


def _box() -> Shape:
    return Shape(
        4,
        {
            "A": lambda w, h, t, s: w * h - (w - 2.0 * s) * (h - 2.0 * t),
            "I1": lambda w, h, t, s: (w * h**3 - (w - 2.0 * s) * (h - 2.0 * t) ** 3) / 12,
            "I2": lambda w, h, t, s: (h * w**3 - (h - 2.0 * t) * (w - 2.0 * s) ** 3) / 12,
            "J": box_torsion,
            "K1": lambda w, h, t, s: 2.0 * h * s / (w * h - (w - 2.0 * s) * (h - 2.0 * t)),
            "K2": lambda w, h, t, s: 2.0 * w * t / (w * h - (w - 2.0 * s) * (h - 2.0 * t)),
        },
        lambda w, h, t, s: w > 2 * s > 0 and h > 2 * t > 0,
        "walls DIM3 and DIM4 should be positive and thinner than half of height DIM2 and width DIM1",
    )


def box_torsion(w: Any, h: Any, t: Any, s: Any) -> Any:
    """Torsion constant of a thin-walled box (Bredt): t at top and bottom, s at the sides."""
    return 2.0 * s * t * (w - s) ** 2 * (h - t) ** 2 / (w * s + h * t - s**2 - t**2)


SHAPES: Mapping[str, Shape] = {"ROD": _rod(), "TUBE": _tube(), "BAR": _bar(), "BOX": _box()}
