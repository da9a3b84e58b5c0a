"""A thick forged bracket, like a steering knuckle, of hexahedra only: hub, two curved arms, and a lug at each end."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from femtune.arrays import Reals
from femtune.fem.fields import FieldRef
from structures.meshed import (
    Hole,
    Material,
    MeshedStructure,
    Patch,
    Property,
    element_batches,
    grid_rows,
    hexahedra,
    node_numbers,
    sized,
    solid_ring,
    ticks,
    weld,
)

# metres: squares with a bore, joined by straight arms along x and y before the bracket is bent
_HUB, _HUB_BORE = (-0.055, 0.055), 0.032
_ARM_X, _ARM_Y = (0.055, 0.2), (0.055, 0.16)
_LUG_X, _LUG_Y = (0.2, 0.27), (0.16, 0.22)
_LUG_BORE = 0.013
_HALF_THICKNESS = 0.025
_GUESS = 0.004

_PARTS = (("hub", 1.70e11), ("arm along x", 1.72e11), ("arm along y", 1.68e11))


def solid_bracket(n_dofs: int = 200_000) -> MeshedStructure:
    """A bracket of cast iron, 0.33 × 0.28 × 0.1 m, of about `n_dofs` degrees of freedom (three a node).

    Its three parts (hub, arm along x, arm along y) have PSOLID 1 to 3 and MAT1 1 to 3.

    Raises
    ------
    FemtuneError : ``testing.mesh-size`` below some 800 degrees of freedom
    """
    return sized([_at_size], n_dofs, _GUESS * (200_000 / n_dofs) ** (1.0 / 3.0))


def solid_bracket_parameters() -> tuple[FieldRef, ...]:
    """Young's modulus, then density of the three parts."""
    numbers = range(1, len(_PARTS) + 1)
    return (*(FieldRef("MAT1", i, "E") for i in numbers), *(FieldRef("MAT1", i, "RHO") for i in numbers))


def _at_size(size: float) -> MeshedStructure:
    mesh = weld(_patches(size))
    properties = tuple(Property(i, name, "PSOLID", i) for i, (name, _) in enumerate(_PARTS, start=1))
    return MeshedStructure(
        title="solid bracket",
        node_ids=node_numbers(len(mesh.points), {}),
        xyz=_bend(mesh.points),
        elements=element_batches(mesh, properties),
        properties=properties,
        materials=tuple(Material(i, f"cast iron, {name}", E, 0.28, 7100.0) for i, (name, E) in enumerate(_PARTS, 1)),
    )


def _patches(size: float) -> Iterator[Patch]:
    z = ticks((-_HALF_THICKNESS, _HALF_THICKNESS), size)
    across = ticks(_HUB, size)
    yield _bored("hub", Hole(across, across, _HUB_BORE), z)
    yield _block("arm along x", ticks(_ARM_X, size), across, z)
    yield _block("arm along y", across, ticks(_ARM_Y, size), z)
    yield _bored("arm along x", Hole(ticks(_LUG_X, size), across, _LUG_BORE), z)
    yield _bored("arm along y", Hole(across, ticks(_LUG_Y, size), _LUG_BORE), z)


def _bored(group: str, hole: Hole, z: Reals) -> Patch:
    return solid_ring(group, hole.rims(), z)


def _block(group: str, x: Reals, y: Reals, z: Reals) -> Patch:
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return Patch(group, points, hexahedra(grid_rows(len(x), len(y), len(z))))


def _bend(points: Reals) -> Reals:
    """Arms that curve upwards, thinner and narrower towards their ends."""
    x, y, z = points.T
    along_x, along_y = (np.clip((c - _HUB[1]) / 0.2, 0.0, None) for c in (x, y))
    thin = 1.0 - 0.35 * _slow(along_x) - 0.25 * _slow(along_y)
    lift = 0.05 * along_x**2 - 0.04 * along_y**2
    return np.column_stack([x * (1.0 - 0.3 * _slow(along_y)), y * (1.0 - 0.3 * _slow(along_x)), z * thin + lift])


def _slow(u: Reals) -> Reals:
    """From 0 with a level start to 1."""
    return np.asarray(u**2 / (0.3 + u**2) * 1.3)
