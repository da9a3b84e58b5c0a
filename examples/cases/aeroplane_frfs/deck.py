"""The GARTEUR SM-AG19 testbed as a Nastran deck, from the corners of a shell mesh; units m, kg, s.

Wing, drums, fin and tailplane are shells; sizes as in the group's papers. Each drum lies on the wing. The constraining
layer (1.1 mm) is bonded to the wing by a viscoelastic film, which is modelled by solids between the middle surfaces:
their shear modulus is that of the film times the distance of the middle surfaces over the thickness of the film. The
fuselage (150 × 50 mm) is a bar. Springs at its top connect wing and fin to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from structures.aeroplane_mesh import AeroplaneMesh

ALUMINIUM = "72.+9,,.34,2700."
WING, DRUM, LAYER, FILM, ROOT, FUSELAGE, FIN, TAILPLANE = 16, 14, 12, 20, 30, 1, 2, 3
"""Numbers of properties and materials."""
DRUM_OVER_WING = 11
THICKNESS = {FIN: 0.010, TAILPLANE: 0.010, DRUM: 0.010, WING: 0.010, DRUM_OVER_WING: 0.020, LAYER: 0.0011}
MATERIAL = {DRUM_OVER_WING: WING, ROOT: WING}
FILM_TO_SOLID = 5.55 / 0.0508
"""Distance of the middle surfaces of wing and layer over the thickness of the film (0.0508 mm)."""
TIP_MASSES, TAIL_MASSES = (21003, 21004), (21001, 21002)
TOP_OF_FUSELAGE, AXIS_OF_FUSELAGE, WING_PLANE = 0.150, 0.075, 0.176
WING_X, FIN_X = 0.6, 1.45
_ROOT_SHELLS = (31, 32)
_LAYERED = frozenset((14, 16, 18, 20, 22, 24, 26, 27, 32, 65, 67, 69, 71, 73, 75, 77, 79))
"""Shells below the constraining layer."""
_OVERLAP = (5, 6, 7, 9, 84, 85, 86, 87)
_LIFT = {DRUM: 0.010, DRUM_OVER_WING: 0.005}
_SIZE, _CHORDWISE, _NEAR_ROOT = 0.0167, 0.0254, 0.0125
"""Lengths of element sides, m."""
_UPPER = 100_000
Corners = tuple[int, ...]


@dataclass(frozen=True)
class _Shell:
    """One element: the number of the shell that it is part of, property, corners."""

    parent: int
    property: int
    corners: Corners


def deck_text(mesh: AeroplaneMesh, sensors: Mapping[int, tuple[float, float, float]]) -> str:
    """The deck.

    Parameters
    ----------
    sensors : places of the sensors, which get grid points with their numbers
    """
    nodes, shells = _divided(mesh)
    used = {n for shell in shells for n in shell.corners}
    nodes = {n: xyz for n, xyz in nodes.items() if n in used}
    root = {n for s in shells if s.property == ROOT for n in s.corners if abs(nodes[n][1]) < 1e-6}
    foot = {n for s in shells if s.property == FIN for n in s.corners if abs(nodes[n][2] - TOP_OF_FUSELAGE) < 1e-6}
    stations = {x: 50_001 + i for i, x in enumerate([*(round(0.025 * k, 3) for k in range(61))])}
    at = nodes | {n: np.array([x, 0.0, AXIS_OF_FUSELAGE]) for x, n in stations.items()}
    lines = [
        *["SOL 103", "CEND", "TITLE = GARTEUR SM-AG19 aeroplane", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,20"],
        *_properties(),
        *(_grid(n, xyz) for n, xyz in sorted(at.items())),
        *_shells(shells, nodes),
        *(f"CBAR,{60_000 + n},{FUSELAGE},{n},{n + 1},0.,0.,1." for n in sorted(stations.values())[:-1]),
        *_joint(9000, 9, ("1.+6", "1.+7"), (WING_X, 0.1605), root, stations[WING_X]),
        *_joint(9010, 10, ("1.+5", "1.+5"), (FIN_X, TOP_OF_FUSELAGE), foot, stations[FIN_X]),
        "$ block between fuselage and wing, 16 x 70 x 130 mm of steel",
        "CONM2,21005,9002,,1.143",
        *(f"CONM2,{21001 + k},{n},,{0.2 if nodes[n][0] < 1.0 else 0.175}" for k, n in enumerate(mesh.groups[10])),
        *_sensors(sensors, {n: xyz for n, xyz in nodes.items() if n < _UPPER and n not in root}, stations),
    ]
    return "\n".join([*lines, "ENDDATA", ""])


def _properties() -> Iterator[str]:
    for number, thickness in THICKNESS.items():
        material = MATERIAL.get(number, number)
        yield f"PSHELL,{number},{material},{thickness:g},{material},,{material}"
    yield "$ wing on its block: thin in its plane, stiff in bending"
    yield f"PSHELL,{ROOT},{WING},.01,{WING},50.,{WING}"
    yield f"PSOLID,{FILM},{FILM}"
    yield f"PBAR,{FUSELAGE},{FUSELAGE},7.5-3,14.0625-6,1.5625-6,4.93-6"
    yield "+"
    yield "+,.8333,.8333"
    for number in sorted({*THICKNESS, FUSELAGE} - {DRUM_OVER_WING}):
        yield f"MAT1,{number},{ALUMINIUM}"
    yield f"MAT1,{FILM},2.+8,,.3,1."


def _shells(shells: Iterable[_Shell], nodes: Mapping[int, np.ndarray]) -> Iterator[str]:
    upper = dict[int, str]()
    for i, shell in enumerate(shells, 1):
        xyz = np.array([nodes[n] for n in shell.corners])
        up = float(np.sign(np.cross(xyz[1] - xyz[0], xyz[3] - xyz[0])[2]))
        lift = f",,{up * _LIFT[shell.property]:g}" if shell.property in _LIFT else ""
        yield f"CQUAD4,{i},{shell.property},{_commas(shell.corners)}{lift}"
        if shell.parent in _LAYERED:
            above = tuple(_UPPER + n for n in shell.corners)
            upper |= {n: _grid(n, [*nodes[n - _UPPER][:2], WING_PLANE + 0.00555]) for n in above}
            yield f"CQUAD4,{_UPPER + i},{LAYER},{_commas(above)}"
            yield from _card(["CHEXA", 2 * _UPPER + i, FILM, *shell.corners[:: int(up)], *above[:: int(up)]])
    yield from upper.values()


def _joint(
    first: int, prop: int, roll_yaw: tuple[str, str], place: tuple[float, float], own: set[int], on: int
) -> Iterator[str]:
    """A spring between a point that carries the grid points `own`, and one that follows the fuselage."""
    x, z = place
    for n in (first + 1, first + 2):
        yield _grid(n, [x, 0.0, z])
    yield from _card(["RBE2", first + 1, first + 1, 123456, *sorted(own)])
    yield f"RBE2,{first + 2},{on},123456,{first + 2}"
    roll, yaw = roll_yaw
    yield f"PBUSH,{prop},K,1.+9,1.+9,1.+9,{roll},1.+7,{yaw}"
    yield f"CBUSH,{first},{prop},{first + 1},{first + 2},,,,0"


def _sensors(
    sensors: Mapping[int, tuple[float, float, float]], nodes: Mapping[int, np.ndarray], stations: Mapping[float, int]
) -> Iterator[str]:
    """Grid points of sensors, rigidly at the next point of the structure: the fuselage below the wing."""
    for n, xyz in sorted(sensors.items()):
        if xyz[2] <= TOP_OF_FUSELAGE:
            on = stations[min(stations, key=lambda x: abs(x - xyz[0]))]
        elif n == 1206:
            on = 9001
        else:
            on = min(nodes, key=lambda k: float(np.linalg.norm(nodes[k] - xyz)))
        yield _grid(n, xyz)
        yield f"RBE2,{30_000 + n},{on},123456,{n}"


def _divided(mesh: AeroplaneMesh) -> tuple[dict[int, np.ndarray], list[_Shell]]:
    """Grid points and elements: opposite sides of all shells of a strip have the same number of elements."""
    nodes = {n: np.round(xyz, 6) for n, xyz in mesh.nodes.items()}
    counts = _counts(mesh, nodes)
    numbers = {tuple(np.round(xyz, 9)): n for n, xyz in nodes.items()}

    def number(xyz: np.ndarray) -> int:
        key = tuple(np.round(xyz, 9))
        if key not in numbers:
            numbers[key] = 10_000 + len(numbers)
            nodes[numbers[key]] = np.array(key)
        return numbers[key]

    shells = []
    for parent, (a, b, c, d) in mesh.shells.items():
        prop = _property(mesh, parent)
        if prop is None:
            continue
        u, v = (np.linspace(0.0, 1.0, counts[frozenset(side)] + 1) for side in ((a, b), (b, c)))
        p, q, r, s = (nodes[n] for n in (a, b, c, d))
        grid = [[number((1 - y) * ((1 - x) * p + x * q) + y * (x * r + (1 - x) * s)) for x in u] for y in v]
        for low, high in pairwise(grid):
            quads = zip(low, low[1:], high[1:], high)
            shells += [_Shell(parent, prop, quad) for quad in quads]
    return nodes, shells


def _property(mesh: AeroplaneMesh, shell: int) -> int | None:
    """Property of a shell; None for the fuselage and its block, which are no shells here."""
    if shell in _ROOT_SHELLS:
        return ROOT
    if shell in _OVERLAP:
        return DRUM_OVER_WING
    return {2: FIN, 3: TAILPLANE, 4: DRUM, 5: DRUM, 6: WING, 7: WING}.get(mesh.thickness_group(shell))


def _counts(mesh: AeroplaneMesh, nodes: Mapping[int, np.ndarray]) -> dict[frozenset[int], int]:
    """Number of elements along each side."""
    strip = dict[frozenset[int], frozenset[int]]()

    def first(side: frozenset[int]) -> frozenset[int]:
        while strip.setdefault(side, side) != side:
            side = strip[side]
        return side

    for a, b, c, d in mesh.shells.values():
        for one, other in (((a, b), (c, d)), ((b, c), (d, a))):
            strip[first(frozenset(one))] = first(frozenset(other))
    needed = dict[frozenset[int], tuple[float, float]]()
    for side in list(strip):
        p, q = (nodes[n] for n in side)
        length, size = needed.get(first(side), (0.0, np.inf))
        needed[first(side)] = max(length, float(np.linalg.norm(p - q))), min(size, _wanted(p, q))
    return {side: max(1, ceil(needed[first(side)][0] / needed[first(side)][1] - 1e-9)) for side in strip}


def _wanted(p: np.ndarray, q: np.ndarray) -> float:
    if max(abs(p[2] - WING_PLANE), abs(q[2] - WING_PLANE)) > 1e-6:
        return _SIZE
    if abs(p[0] - q[0]) > abs(p[1] - q[1]):
        return _CHORDWISE
    return _NEAR_ROOT if abs(p[1] + q[1]) < 0.28 else _SIZE


def _grid(number: int, xyz: Iterable[float]) -> str:
    return f"GRID,{number},," + ",".join(f"{c:.6f}".rstrip("0") for c in xyz)


def _commas(numbers: Corners) -> str:
    return ",".join(map(str, numbers))


def _card(fields: list[object]) -> Iterator[str]:
    """A card with as many continuation lines as it needs."""
    name, *rest = map(str, fields)
    yield ",".join([name, *rest[:8]])
    for k in range(8, len(rest), 8):
        yield ",".join(["+", *rest[k : k + 8]])
