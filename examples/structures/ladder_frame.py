"""A ladder frame of closed box sections, shells only, in six regions: for studies of reduced models."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from femtune.arrays import Reals
from femtune.fem.fields import FieldRef
from structures.meshed import (
    Material,
    MeshedStructure,
    Patch,
    Property,
    element_batches,
    node_numbers,
    sheet,
    sized,
    ticks,
    weld,
)

# metres: rails along x that change their region in the middle, cross members between them, all of one height
_RAIL_X = (-0.7, -0.55, -0.47, 0.0, 0.35, 0.44, 0.7)
_RAIL_Y = (0.27, 0.35)
_CROSS_X = {"front": (-0.55, -0.47), "rear": (0.35, 0.44)}
_HALF_HEIGHT = 0.035
_GUESS = 0.018

_REGIONS = (
    ("rail left front", 2.10e11, 2.4e-3),
    ("rail left rear", 2.05e11, 2.0e-3),
    ("rail right front", 2.08e11, 2.2e-3),
    ("rail right rear", 2.12e11, 1.9e-3),
    ("cross front", 2.06e11, 1.8e-3),
    ("cross rear", 2.00e11, 2.6e-3),
)


def shell_frame(n_dofs: int = 40_000) -> MeshedStructure:
    """A frame of two rails and two cross members, 1.4 × 0.7 × 0.07 m, of about `n_dofs` degrees of freedom.

    Region i has PSHELL i and MAT1 i of its own; values differ between regions so that no frequency is repeated.

    Raises
    ------
    FemtuneError : ``testing.mesh-size`` below some 2,000 degrees of freedom
    """
    return sized([_at_size], n_dofs, _GUESS * (40_000 / n_dofs) ** 0.5)


def shell_frame_parameters() -> tuple[FieldRef, ...]:
    """Thickness, then Young's modulus of the six regions."""
    numbers = range(1, len(_REGIONS) + 1)
    return (*(FieldRef("PSHELL", i, "T") for i in numbers), *(FieldRef("MAT1", i, "E") for i in numbers))


def _at_size(size: float) -> MeshedStructure:
    mesh = weld([*_rail(size, "left", 1), *_rail(size, "right", -1), *_cross(size, "front"), *_cross(size, "rear")])
    numbered = list(enumerate(_REGIONS, start=1))
    properties = tuple(Property(i, name, "PSHELL", i, (t,)) for i, (name, _, t) in numbered)
    return MeshedStructure(
        title="shell frame in six regions",
        node_ids=node_numbers(len(mesh.points), {}),
        xyz=_bend(mesh.points),
        elements=element_batches(mesh, properties),
        properties=properties,
        materials=tuple(Material(i, f"steel, {name}", E, 0.3, 7850.0) for i, (name, E, _) in numbered),
    )


def _rail(size: float, name: str, sign: int) -> Iterator[Patch]:
    y, z = ticks([sign * y for y in _RAIL_Y], size), _heights(size)
    for end, breaks in (("front", [x for x in _RAIL_X if x <= 0.0]), ("rear", [x for x in _RAIL_X if x >= 0.0])):
        group, x = f"rail {name} {end}", ticks(breaks, size)
        yield sheet(group, x, sign * _RAIL_Y[1], z, sign)
        yield sheet(group, x, sign * _RAIL_Y[0], z, -sign)
        yield from (sheet(group, x, y, side * _HALF_HEIGHT, side) for side in (-1, 1))
    yield sheet(f"rail {name} front", _RAIL_X[0], y, z, -1)
    yield sheet(f"rail {name} rear", _RAIL_X[-1], y, z, 1)


def _cross(size: float, end: str) -> Iterator[Patch]:
    group, (front, rear) = f"cross {end}", _CROSS_X[end]
    x, y, z = ticks((front, rear), size), ticks((-_RAIL_Y[0], _RAIL_Y[0]), size), _heights(size)
    yield sheet(group, front, y, z, -1)
    yield sheet(group, rear, y, z, 1)
    yield from (sheet(group, x, y, side * _HALF_HEIGHT, side) for side in (-1, 1))


def _heights(size: float) -> Reals:
    return ticks((-_HALF_HEIGHT, _HALF_HEIGHT), size)


def _bend(points: Reals) -> Reals:
    """A slow rise towards the rear and narrower rails in front, so that nothing is symmetric."""
    x, y, z = points.T
    return np.column_stack([x, y * (1.0 + 0.08 * x), z * (1.0 - 0.15 * x) + 0.04 * (x + 0.7) ** 2])
