"""Torsion constants: a solid rectangle, thin walls in a row, closed boxes.

Sources: Roark's Formulas for Stress and Strain, table 10.7 (rectangle); Bredt's formula (closed cells); thin walls
resist as Σ b t³/3 over their middle lines (Timoshenko and Goodier, Theory of Elasticity, section 109).
"""

from __future__ import annotations

from typing import Any

from femtune.files.nastran.sections.shape import total


def rectangle_torsion(w: Any, h: Any) -> Any:
    """Torsion constant of a solid rectangle, a b³ (1/3 − 0.21 b/a (1 − b⁴/12a⁴)) with a ≥ b (Roark, table 10.7)."""
    wide = getattr(w, "value", w).real >= getattr(h, "value", h).real
    a, b = (w, h) if wide else (h, w)
    return a * b**3 * (1 / 3 - 0.21 * b / a * (1.0 - b**4 / (12.0 * a**4)))


def thin_walls(*walls: tuple[Any, Any]) -> Any:
    """Torsion constant Σ b t³/3 of an open section from lengths b and thicknesses t of its walls."""
    return total([length * thickness**3 for length, thickness in walls]) / 3.0


def closed_cell(area: Any, *walls: tuple[Any, Any]) -> Any:
    """Torsion constant 4 A² / Σ b/t of a closed cell from the area inside its middle line (Bredt)."""
    return 4.0 * area**2 / total([length / thickness for length, thickness in walls])


def box_torsion(w: Any, h: Any, t: Any, s: Any) -> Any:
    """Torsion constant of a thin-walled box (Bredt): t at top and bottom, s at the sides."""
    return 2.0 * s * t * (w - s) ** 2 * (h - t) ** 2 / (w * s + h * t - s**2 - t**2)
