"""A section shape, and the properties of a section that consists of rectangles.

Dimensions and properties are numbers, complex numbers or jets: plain arithmetic throughout.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from femtune.fem.rules import makes_rules
from femtune.files.nastran.sections.torsion import larger, rectangle_torsion
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
    properties : dimensions -> A I1 I2 I12 J K1 K2 and N1 N2, the neutral axis relative to the shear centre
    valid : dimensions -> True if they define a section
    rule : the condition of `valid` as text
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
        """One function of the dimensions per property; successive calls with equal dimensions share one evaluation."""
        shared = _Remembering(self.properties)
        return {role: _formula(shared, role) for role in SECTION_ROLES}


class _Remembering:
    """The properties of the last dimensions, cached."""

    def __init__(self, properties: Callable[..., Properties]) -> None:
        self.properties = properties
        self.last: tuple[Any, Properties] = (None, {})

    def __call__(self, *dimensions: Any) -> Properties:
        key = tuple(map(_content, dimensions))
        known, properties = self.last
        if key != known:
            properties = self.properties(*dimensions)
            self.last = (key, properties)
        return properties


def _content(x: Any) -> Any:
    """Content of a number or a jet, for comparison."""
    if not isinstance(x, Jet):
        return x
    return (x.grad.shape, *((part.dtype.char, part.tobytes()) for part in (x.value, x.grad, x.hess)))


@makes_rules
def _formula(shared: _Remembering, role: str) -> Formula:
    return lambda *dimensions: shared(*dimensions)[role]


def symmetric(area: Any, I1: Any, I2: Any, J: Any, K1: Any, K2: Any) -> Properties:
    """Properties of a section that is symmetric about both axes."""
    zero = 0.0 * area
    values = {"A": area, "I1": I1, "I2": I2, "I12": zero, "J": J, "K1": K1 + zero, "K2": K2 + zero}
    return {**values, "N1": zero, "N2": zero}


def composite(
    parts: Sequence[Rectangle], torsion: Any, upright: Any, level: Any, centre: tuple[Any, Any] | None = None
) -> Properties:
    """Properties of a section made of rectangles that do not overlap.

    Parameters
    ----------
    parts : the rectangles
    torsion : torsion constant; limited to at least that of the rectangles alone and at most that of their bounding box
    upright, level : areas that carry the shear along y and along z; divided by the area they are the shear factors
    centre : shear centre (y, z) in the drawing; None if it is the centroid
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
    torsion = larger(torsion, total([rectangle_torsion(p.width, p.height) for p in parts]))
    torsion = -larger(-torsion, -rectangle_torsion(*_extents(parts)))
    return {"A": A, "I1": I1, "I2": I2, "I12": I12, "J": torsion, "K1": upright / A, "K2": level / A, **offset}


def _extents(parts: Sequence[Rectangle]) -> tuple[Any, Any]:
    """Height and width of all rectangles together."""
    ends = ([(p.y, p.height) for p in parts], [(p.z, p.width) for p in parts])
    height, width = (
        reduce(larger, [c + e / 2.0 for c, e in along]) + reduce(larger, [e / 2.0 - c for c, e in along])
        for along in ends
    )
    return height, width


def total(terms: Sequence[Any]) -> Any:
    """Sum without the initial integer zero of the builtin."""
    out = terms[0]
    for term in terms[1:]:
        out = out + term
    return out


# ----------------------------------------------------------------------------------------------------
# Shear factors of thin-walled sections from the flow of shear along their middle lines.
#
# A shear V along an axis bends by V b·r, b from the inverse of the moments of inertia; the flow is q = V S with S = ∫
# (b·r) t ds from the free ends, and 1/κA = ∫ S²/t ds. Source: Cowper 1966 at ν =
# 0, in the form of the energy of Saint-Venant's flow (Pilkey, Analysis and Design of Elastic Beams, 2002, chapter 6).


Point = tuple[Any, Any]
Wall = tuple[str, str, Any, Any]

# three Gauss points integrate the fourth powers of S²
_GAUSS = ((0.5 - 0.15**0.5, 5 / 18), (0.5, 8 / 18), (0.5 + 0.15**0.5, 5 / 18))


def shear_areas(points: Mapping[str, Point], walls: Sequence[Wall]) -> tuple[Any, Any]:
    """κA for shears along y and along z.

    Parameters
    ----------
    points : middle lines' corners (y, z)
    walls : (from, to, length, thickness), each after the walls that end at its start; the flow of all walls that
        end at a point continues in the first wall that starts there
    """
    area = total([length * t for _, _, length, t in walls])
    y, z = (
        total([length * t * (points[a][k] + points[b][k]) / 2.0 for a, b, length, t in walls]) / area for k in (0, 1)
    )
    places = {name: (point[0] - y, point[1] - z) for name, point in points.items()}
    I1, I2, I12 = (_product(places, walls, j, k) for j, k in ((0, 0), (1, 1), (0, 1)))
    determinant = I1 * I2 - I12 * I12
    bends = (I2 / determinant, -(I12 / determinant)), (-(I12 / determinant), I1 / determinant)
    first, second = (_area(places, walls, bend) for bend in bends)
    return first, second


def _product(places: Mapping[str, Point], walls: Sequence[Wall], j: int, k: int) -> Any:
    ends = [(places[a], places[b], length * t) for a, b, length, t in walls]
    return total([(2.0 * (p[j] * p[k] + q[j] * q[k]) + p[j] * q[k] + q[j] * p[k]) * area / 6.0 for p, q, area in ends])


def _area(places: Mapping[str, Point], walls: Sequence[Wall], bend: Point) -> Any:
    """1 / ∫ S²/t ds."""
    flows = _flows(places, walls, bend)
    return 1.0 / total([w * x**2 * length / t for flow, (_, _, length, t) in zip(flows, walls)
                        for x, (_, w) in zip(flow, _GAUSS)])  # fmt: skip


def _flows(places: Mapping[str, Point], walls: Sequence[Wall], bend: Point) -> list[list[Any]]:
    """S at the Gauss points of each wall."""
    arriving: dict[str, Any] = {}
    flows = []
    for a, b, length, t in walls:
        f, g = (bend[0] * places[end][0] + bend[1] * places[end][1] for end in (a, b))
        start = arriving.pop(a, 0.0 * f)
        flows.append([start + t * length * (f * x + (g - f) * (x**2 / 2.0)) for x, _ in _GAUSS])
        end = start + t * length * (f + g) / 2.0
        arriving[b] = arriving[b] + end if b in arriving else end
    return flows
