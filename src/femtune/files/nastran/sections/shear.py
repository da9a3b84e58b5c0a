"""Shear factors of thin-walled sections from the flow of shear along their middle lines.

A shear V along an axis bends by V b·r, b from the inverse of the moments of inertia; the flow is q = V S with
S = ∫ (b·r) t ds from the free ends (and a closing constant in a cell), and 1/κA = ∫ S²/t ds. Source: Cowper 1966 at
ν = 0, in the form of the energy of Saint-Venant's flow (Pilkey, Analysis and Design of Elastic Beams, 2002, chapter 6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from femtune.files.nastran.sections.shape import total

Point = tuple[Any, Any]
Wall = tuple[str, str, Any, Any]

# three Gauss points integrate the fourth powers of S²
_GAUSS = ((0.5 - 0.15**0.5, 5 / 18), (0.5, 8 / 18), (0.5 + 0.15**0.5, 5 / 18))


def shear_areas(points: Mapping[str, Point], walls: Sequence[Wall], cell: bool = False) -> tuple[Any, Any]:
    """κA for shears along y and along z.

    Parameters
    ----------
    points : middle lines' corners (y, z)
    walls : (from, to, length, thickness), each after those that end where it starts; the flow of all that end at a
        point goes on in the first that starts there
    cell : True where the walls close to a ring
    """
    area = total([length * t for _, _, length, t in walls])
    y, z = (
        total([length * t * (points[a][k] + points[b][k]) / 2.0 for a, b, length, t in walls]) / area for k in (0, 1)
    )
    places = {name: (point[0] - y, point[1] - z) for name, point in points.items()}
    I1, I2, I12 = (_product(places, walls, j, k) for j, k in ((0, 0), (1, 1), (0, 1)))
    determinant = I1 * I2 - I12 * I12
    bends = (I2 / determinant, -(I12 / determinant)), (-(I12 / determinant), I1 / determinant)
    first, second = (_area(places, walls, bend, cell) for bend in bends)
    return first, second


def _product(places: Mapping[str, Point], walls: Sequence[Wall], j: int, k: int) -> Any:
    ends = [(places[a], places[b], length * t) for a, b, length, t in walls]
    return total([(2.0 * (p[j] * p[k] + q[j] * q[k]) + p[j] * q[k] + q[j] * p[k]) * area / 6.0 for p, q, area in ends])


def _area(places: Mapping[str, Point], walls: Sequence[Wall], bend: Point, cell: bool) -> Any:
    """1 / ∫ S²/t ds."""
    flows = _flows(places, walls, bend)
    if cell:
        ring = total([length / t for _, _, length, t in walls])
        closing = -total([w * x * length / t for flow, (_, _, length, t) in zip(flows, walls)
                          for x, (_, w) in zip(flow, _GAUSS)]) / ring  # fmt: skip
        flows = [[x + closing for x in flow] for flow in flows]
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
