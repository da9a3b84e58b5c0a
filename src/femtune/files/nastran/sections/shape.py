"""A section shape, and the properties of a section that is put together from rectangles.

Dimensions and properties are numbers, complex numbers or jets: plain arithmetic throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from femtune.parameters.jet import Jet

# area, moments of inertia about the neutral axis, torsion, shear factors, neutral axis from the shear centre
SECTION_ROLES = ("A", "I1", "I2", "I12", "J", "K1", "K2", "N1", "N2")
Properties = Mapping[str, Any]
Formula = Callable[..., Any]


@dataclass(frozen=True)
class Rectangle:
    """A rectangle of a section: its centre (y, z) in the drawing, its extent along y and along z."""

    y: Any
    z: Any
    height: Any
    width: Any


@dataclass(frozen=True)
class Shape:
    """A section with `n` dimensions.

    Parameters
    ----------
    n : number of dimensions
    properties : dimensions -> A I1 I2 I12 J K1 K2 and N1 N2, the neutral axis seen from the shear centre
    valid : dimensions -> whether they make a section
    rule : what valid asks for, in words
    """

    n: int
    properties: Callable[..., Properties]
    valid: Callable[..., bool]
    rule: str

    @property
    def dimensions(self) -> tuple[str, ...]:
        """DIM1 … DIMn."""
        return tuple(f"DIM{i + 1}" for i in range(self.n))

    @property
    def formulas(self) -> Mapping[str, Formula]:
        """One function of the dimensions for each property; asked for in a row they share one evaluation."""
        shared = _Remembering(self.properties)
        return {role: _formula(shared, role) for role in SECTION_ROLES}


class _Remembering:
    """The properties of the dimensions that were asked for last."""

    def __init__(self, properties: Callable[..., Properties]) -> None:
        self.properties = properties
        self.last: tuple[Any, Properties] = (None, {})

    def __call__(self, *dimensions: Any) -> Properties:
        key = tuple(map(_content, dimensions))
        known, found = self.last
        if key != known:
            found = self.properties(*dimensions)
            self.last = (key, found)
        return found


def _content(x: Any) -> Any:
    """What a number or a jet holds, to be compared."""
    if not isinstance(x, Jet):
        return x
    return (x.grad.shape, *((part.dtype.char, part.tobytes()) for part in (x.value, x.grad, x.hess)))


def _formula(shared: _Remembering, role: str) -> Formula:
    return lambda *dimensions: shared(*dimensions)[role]


def symmetric(area: Any, I1: Any, I2: Any, J: Any, K1: Any, K2: Any) -> Properties:
    """Properties of a section that is symmetric about both axes."""
    zero = 0.0 * area
    found = {"A": area, "I1": I1, "I2": I2, "I12": zero, "J": J, "K1": K1 + zero, "K2": K2 + zero}
    return {**found, "N1": zero, "N2": zero}


def composite(
    parts: Sequence[Rectangle], torsion: Any, upright: Any, level: Any, centre: tuple[Any, Any] | None = None
) -> Properties:
    """Properties of a section made of rectangles that do not overlap.

    Parameters
    ----------
    parts : the rectangles
    torsion : torsion constant
    upright, level : areas that carry the shear along y and along z; the shear factors are their shares
    centre : shear centre (y, z) in the drawing; None where it is the centroid
    """
    areas = [p.height * p.width for p in parts]
    A = total(areas)
    y = total([a * p.y for a, p in zip(areas, parts)]) / A
    z = total([a * p.z for a, p in zip(areas, parts)]) / A
    I1 = total([a * (p.height**2 / 12.0 + (p.y - y) ** 2) for a, p in zip(areas, parts)])
    I2 = total([a * (p.width**2 / 12.0 + (p.z - z) ** 2) for a, p in zip(areas, parts)])
    I12 = total([a * ((p.y - y) * (p.z - z)) for a, p in zip(areas, parts)])
    ys, zs = (y, z) if centre is None else centre
    offset = {"N1": y - ys + 0.0 * A, "N2": z - zs + 0.0 * A}
    return {"A": A, "I1": I1, "I2": I2, "I12": I12, "J": torsion, "K1": upright / A, "K2": level / A, **offset}


def total(terms: Sequence[Any]) -> Any:
    """Sum without the integer zero that the builtin starts from."""
    out = terms[0]
    for term in terms[1:]:
        out = out + term
    return out
