"""A car subframe as a test bed: pressed steel members, welds, bolts, rubber bushings and accelerometers.

Two curved side members and three arched cross members, closed boxes of two half shells each with flanges at the seam,
joined node to node; gussets; four brackets bolted on with two bolts each (RBE2); four bushings of rubber between
steel sleeves, each with an RBE2 in its bore whose middle node is the mount; stiffeners (CBAR) along two cross members;
sixty accelerometers (CONM2). About 1.0 × 0.6 × 0.2 m and 20 kg, in SI units (m, N, kg). The geometry is the same at
any number of degrees of freedom. ``python -m femtune.testing.subframe 40000 out.bdf`` writes a deck.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from femtune.fem.values import FieldRef
from femtune.testing.subframe_deck import write_structure
from femtune.testing.subframe_members import (
    BRACKET_X,
    BUSHING_X,
    CROSSES,
    SIDES,
    Drawing,
    bend,
    bolt_points,
    mount_points,
    sensor_places,
    stiffener_points,
)
from femtune.testing.subframe_patches import Patch, Weld, weld
from femtune.testing.subframe_structure import (
    Material,
    MeshedStructure,
    PointMass,
    Property,
    RigidTie,
    element_batches,
    node_numbers,
    sized,
)

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

SENSORS = 60
SENSOR_MASS = 0.004
MOUNT_MASS, MOUNT_INERTIA = 2.6, 2.5e-3
FIRST_SENSOR, FIRST_BOLT, FIRST_MOUNT = 101, 201, 301
_FIRST_TIE, _FIRST_MASS = 9_000_001, 9_100_001
_GUESS, _ASPECTS = 0.02, (1.0, 1.15, 0.85)

MATERIALS = (
    Material(1, "steel of the side members", 2.10e11, 0.3, 7850.0),
    Material(2, "steel of the cross members", 2.07e11, 0.3, 7850.0),
    Material(3, "steel of brackets, gussets and sleeves", 2.05e11, 0.29, 7850.0),
    Material(4, "rubber of the front bushings", 6.0e6, 0.49, 1100.0, 0.15),
    Material(5, "rubber of the rear bushings", 9.0e6, 0.49, 1120.0, 0.12),
)
PROPERTIES = (
    Property(1, "side left lower", "PSHELL", 1, (2.2e-3,)),
    Property(2, "side left upper", "PSHELL", 1, (1.8e-3,)),
    Property(3, "side right lower", "PSHELL", 1, (2.2e-3,)),
    Property(4, "side right upper", "PSHELL", 1, (1.8e-3,)),
    Property(5, "cross front lower", "PSHELL", 2, (1.8e-3,)),
    Property(6, "cross front upper", "PSHELL", 2, (1.6e-3,)),
    Property(7, "cross middle lower", "PSHELL", 2, (1.6e-3,)),
    Property(8, "cross middle upper", "PSHELL", 2, (1.5e-3,)),
    Property(9, "cross rear lower", "PSHELL", 2, (1.8e-3,)),
    Property(10, "cross rear upper", "PSHELL", 2, (1.6e-3,)),
    Property(11, "side flanges", "PSHELL", 1, (3.6e-3,)),
    Property(12, "cross flanges", "PSHELL", 2, (3.0e-3,)),
    Property(13, "gussets", "PSHELL", 3, (3.0e-3,)),
    Property(14, "brackets front", "PSHELL", 3, (3.0e-3,)),
    Property(15, "brackets rear", "PSHELL", 3, (2.5e-3,)),
    Property(16, "outer sleeves", "PSHELL", 3, (2.5e-3,)),
    Property(17, "rubber front", "PSOLID", 4),
    Property(18, "rubber rear", "PSOLID", 5),
    Property(19, "inner sleeves", "PSOLID", 3),
    Property(20, "stiffeners", "PBAR", 3, (1.2e-4, 1.44e-9, 1.0e-9, 2.0e-9)),
)


@dataclass(frozen=True, eq=False)
class Subframe(MeshedStructure):
    """The structure with the numbers of its accelerometers, bolt nodes and mounts (middles of the bushings)."""

    sensors: tuple[int, ...] = ()
    bolts: tuple[int, ...] = ()
    mounts: tuple[int, ...] = ()


def subframe(n_dofs: int, solids: bool = True, seed: int = 0) -> Subframe:
    """A subframe of about `n_dofs` degrees of freedom (within some per cent), from 5,000 to 1,000,000.

    Parameters
    ----------
    solids : False leaves rubber and inner sleeves away; the mounts then hold the outer sleeves
    seed : of the first accelerometer's place; the others are put as far as possible from those before

    Raises
    ------
    FemtuneError : ``testing.mesh-size`` below some 5,000 degrees of freedom
    """
    builds = [partial(_at_size, solids=solids, seed=seed, aspect=aspect) for aspect in _ASPECTS]
    made = sized(builds, n_dofs, _GUESS * (40_000 / n_dofs) ** 0.5)
    assert isinstance(made, Subframe)
    return made


def write_subframe(structure: MeshedStructure, path: Path | str, boundary: str = "free") -> Path:
    """Write a Nastran deck of normal modes (SOL 103, 56 modes) in SI units; see `subframe_deck.write_structure`.

    Parameters
    ----------
    boundary : "free"; "held" holds the mounts; "loaded" puts a mass of 2.6 kg on each of them
    """
    mounts = structure.mounts if isinstance(structure, Subframe) else ()
    if boundary == "held":
        return write_structure(structure, path, held=mounts)
    if boundary == "loaded":
        return write_structure(structure, path, added=_mount_masses(structure, mounts))
    if boundary == "free":
        return write_structure(structure, path)
    raise ValueError(f'boundary is "free", "held" or "loaded", not {boundary!r}')


def subframe_study_parameters(solids: bool = True) -> tuple[FieldRef, ...]:
    """Twelve thicknesses and three moduli: steel of the sides and both rubbers, without solids the three steels."""
    thicknesses = [FieldRef("PSHELL", number, "T") for number in range(1, 13)]
    moduli = [FieldRef("MAT1", number, "E") for number in ((1, 4, 5) if solids else (1, 2, 3))]
    return (*thicknesses, *moduli)


def _at_size(size: float, solids: bool, seed: int, aspect: float = 1.0) -> Subframe:
    draw = Drawing(size, solids, aspect)
    mesh = weld([*draw.patches(), *_stiffeners(draw)])
    ties = _ties(draw, mesh)
    sensors = dict(zip(_sensor_rows(mesh, seed), range(FIRST_SENSOR, FIRST_SENSOR + SENSORS), strict=True))
    xyz = bend(mesh.points)
    xyz = np.concatenate([xyz, [xyz[tie.rows].mean(axis=0) for tie in ties]])
    named = {**sensors, **_tie_nodes(ties)}
    used = {name for name, _ in mesh.cells}
    properties = tuple(p for p in PROPERTIES if p.name in used)
    return Subframe(
        title="car subframe" + ("" if solids else " without the solids of its bushings"),
        node_ids=node_numbers(len(xyz), named),
        xyz=xyz,
        elements=element_batches(mesh, properties),
        properties=properties,
        materials=tuple(m for m in MATERIALS if m.id in {p.material for p in properties}),
        rigid=ties,
        masses=tuple(PointMass(_FIRST_MASS + i, "accelerometer", row, SENSOR_MASS) for i, row in enumerate(sensors)),
        sensors=tuple(sensors.values()),
        bolts=tuple(n for n in named.values() if FIRST_BOLT <= n < FIRST_MOUNT),
        mounts=tuple(n for n in named.values() if n >= FIRST_MOUNT),
    )


def _stiffeners(draw: Drawing) -> list[Patch]:
    lines = [stiffener_points(draw, cross) for cross in CROSSES if cross.gusset]
    return [Patch("stiffeners", p, np.stack([np.arange(len(p) - 1), np.arange(1, len(p))], axis=-1)) for p in lines]


def _ties(draw: Drawing, mesh: Weld) -> tuple[RigidTie, ...]:
    """Bolts, then mounts; their middle nodes follow the nodes of the mesh."""
    bolts = [hole for sign in SIDES.values() for end in BRACKET_X for hole in draw.bolts(sign, end)]
    rims = [("bolt", bolt_points(hole), "123456") for hole in bolts]
    grip = "123" if draw.solids else "123456"
    rims += [("mount", mount_points(draw, sign, end), grip) for sign in SIDES.values() for end in BUSHING_X]
    return tuple(
        RigidTie(_FIRST_TIE + i, name, len(mesh.points) + i, mesh.rows(points), components)
        for i, (name, points, components) in enumerate(rims)
    )


def _tie_nodes(ties: tuple[RigidTie, ...]) -> dict[int, int]:
    first = {"bolt": FIRST_BOLT, "mount": FIRST_MOUNT}
    named: dict[int, int] = {}
    for tie in ties:
        named[tie.centre] = first[tie.name]
        first[tie.name] += 1
    return named


def _sensor_rows(mesh: Weld, seed: int) -> list[int]:
    """Rows of the nodes under the accelerometers, each as far as possible from those before."""
    places = np.array(list(sensor_places().values()))
    chosen = [int(np.random.default_rng(seed).integers(len(places)))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < SENSORS:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return [int(row) for row in mesh.rows(places[chosen])]


def _mount_masses(structure: MeshedStructure, mounts: tuple[int, ...]) -> tuple[PointMass, ...]:
    rows = np.flatnonzero(np.isin(structure.node_ids, mounts))
    start = _FIRST_MASS + SENSORS
    return tuple(PointMass(start + i, "mass on mount", int(r), MOUNT_MASS, MOUNT_INERTIA) for i, r in enumerate(rows))


def main(arguments: list[str]) -> int:
    """Write the deck of a subframe: number of degrees of freedom, path, and "shells" to leave the solids away."""
    if len(arguments) not in (2, 3) or not arguments[0].isdigit():
        print("usage: python -m femtune.testing.subframe <degrees of freedom> <deck> [shells]", file=sys.stderr)
        return 2
    made = subframe(int(arguments[0]), solids="shells" not in arguments[2:])
    print(f"{write_subframe(made, arguments[1])}: {made.n_dofs} degrees of freedom, {len(made.xyz)} grids")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
