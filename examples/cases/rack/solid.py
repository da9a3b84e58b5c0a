"""The rack of solids as an input file of CalculiX: hexahedra with incompatible modes (C3D8I).

All parts are boxes of one rectilinear grid, so that the mesh needs no mesher: tubes have walls of one element, blocks
are solid, and panels sit in slots of the tubes. Everything is one continuum: joints are rigid.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from geometry import (
    BACK,
    BEAM,
    BOARD,
    BOARDS,
    CONNECTED,
    EDGE,
    HALF,
    JOINED,
    MATERIALS,
    POISSON,
    SHEET,
    STEEL,
    WALL,
    X,
    Y,
    Z,
    at_edge,
    sensors,
)  # fmt: skip

_BETWEEN = {"x": (6,), "y": (4,), "z": (6, 4)}
"""Cells between the connected parts."""
_CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
"""Nodes of an element on the grid."""


def _lines(axes: tuple[float, ...], between: tuple[int, ...], sheets: dict[float, float], divided: int) -> np.ndarray:
    """Grid lines along one direction."""
    found = []
    for axis in axes:
        found += [axis - HALF, axis - HALF + WALL, axis + HALF - WALL, axis + HALF]
        if axis in sheets:
            found += [axis - sheets[axis] / 2, axis + sheets[axis] / 2]
    for (a, b), cells in zip(pairwise(axes), between, strict=True):
        ends = (a + HALF, a + HALF + CONNECTED, b - HALF - CONNECTED, b - HALF)
        for (first, last), parts in zip(pairwise(ends), (1, cells, 1), strict=True):
            found += np.linspace(first, last, divided * parts + 1).tolist()
    return np.unique(np.round(found, 9))


@dataclass(frozen=True)
class SolidMesh:
    """Nodes and elements; numbers of sensors are those of `geometry.sensors`.

    Parameters
    ----------
    divided : parts of each cell along the tubes and in the planes of the panels
    """

    divided: int = 1

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Grid lines along x, y and z."""
        return (
            _lines(X, _BETWEEN["x"], {}, self.divided),
            _lines(Y, _BETWEEN["y"], {BACK: SHEET}, self.divided),
            _lines(Z, _BETWEEN["z"], dict.fromkeys(BOARDS, BOARD), self.divided),
        )

    @cached_property
    def cells(self) -> list[tuple[tuple[int, int, int], int]]:
        """Cells that are not empty, with their material."""
        middles = [0.5 * (line[1:] + line[:-1]) for line in self.lines]
        found = []
        for cell in product(*(range(len(m)) for m in middles)):
            number = _material(np.array([m[i] for m, i in zip(middles, cell)]))
            if number:
                found.append((cell, number))
        return found

    @cached_property
    def nodes(self) -> dict[tuple[int, int, int], int]:
        """Numbers by place on the grid; the node beside each sensor has its number."""
        used = sorted({tuple(int(i) for i in np.array(cell) + n) for cell, _ in self.cells for n in _CORNERS})
        numbers = {place: i for i, place in enumerate(used, start=1001)}
        places = np.array([self.place(node) for node in used])  # type: ignore[arg-type]
        for number, (_, outside) in sensors().items():
            away = np.linalg.norm(places - np.array(outside), axis=1)
            assert away.min() < SHEET, (number, outside)
            numbers[used[int(away.argmin())]] = number
        return numbers  # type: ignore[return-value]

    def place(self, node: tuple[int, int, int]) -> list[float]:
        """Coordinates of a node."""
        return [float(line[i]) for line, i in zip(self.lines, node)]

    def on_table(self, node: tuple[int, int, int]) -> bool:
        """Whether a node lies under one of the blocks on the table."""
        x, y, z = self.place(node)
        near = (any(abs(c - a) < HALF + 1e-9 for a in axes) for c, axes in ((x, X), (y, Y)))
        return z < 1e-9 and all(near)


def _material(at: np.ndarray) -> int:
    """Material at a point; 0 outside of everything."""
    away = [min((c - a for a in axes), key=abs) for c, axes in zip(at, (X, Y, Z))]
    inside = [abs(d) < HALF for d in away]
    if all(inside):
        return STEEL
    for axis, axes in enumerate((X, Y, Z)):
        others = [i for i in range(3) if i != axis]
        if all(inside[i] for i in others) and axes[0] < at[axis] < axes[-1]:
            if all(abs(away[i]) < HALF - WALL for i in others):
                return 0
            return JOINED if abs(away[axis]) < HALF + CONNECTED else BEAM
    in_frame = [axes[0] < c < axes[-1] and not i for c, axes, i in zip(at, (X, Y, Z), inside)]
    on_board = any(abs(at[2] - z) < BOARD / 2 for z in BOARDS) and in_frame[0] and in_frame[1]
    on_back = abs(at[1] - BACK) < SHEET / 2 and in_frame[0] and in_frame[2]
    if on_board:
        return EDGE if at_edge((at[0], at[1]), (X, Y)) else STEEL
    if on_back:
        return EDGE if at_edge((at[0], at[2]), (X, Z)) else STEEL
    return 0


def input_text(modes: int, *, table: bool = False, values: dict[str, float] | None = None, divided: int = 1) -> str:
    """The input file: with placeholders for the parameters that have no value, free or with its feet on the table."""
    mesh = SolidMesh(divided)
    lines = ["*NODE, NSET=NALL"]
    lines += [f"{number},{','.join(f'{c:.9g}' for c in mesh.place(p))}" for p, number in mesh.nodes.items()]
    for number, (name, _, _) in MATERIALS.items():
        lines.append(f"*ELEMENT, TYPE=C3D8I, ELSET={name}")
        for e, (cell, material) in enumerate(mesh.cells, start=1):
            if material == number:
                nodes = (mesh.nodes[tuple(int(i) for i in np.array(cell) + n)] for n in _CORNERS)
                lines.append(f"{e},{','.join(map(str, nodes))}")
    for number, (name, E, density) in MATERIALS.items():
        E_text, density_text = (
            f"{values[key]:.9e}" if values and key in values else f"{{{{{key}:.9e}}}}" for key in (E, density)
        )
        lines += [
            f"*MATERIAL, NAME={name}", "*ELASTIC", f"{E_text},{POISSON[number]}", "*DENSITY", density_text,
            f"*SOLID SECTION, ELSET={name}, MATERIAL={name}",
        ]  # fmt: skip
    held = [n for p, n in mesh.nodes.items() if mesh.on_table(p)] if table else []
    lines += ["*NSET, NSET=SENSORS", *(f"{n}," for n in (*sensors(), *held))]
    if table:
        lines += ["*BOUNDARY", *(f"{n},1,3" for n in held)]
    lines += ["*STEP", "*FREQUENCY", str(modes), "*NODE FILE, NSET=SENSORS", "U, RF" if table else "U", "*END STEP", ""]
    return "\n".join(lines)


def mass(values: dict[str, float]) -> float:
    """Mass of the model, kg."""
    mesh, total = SolidMesh(), 0.0
    for cell, material in mesh.cells:
        volume = float(np.prod([line[i + 1] - line[i] for line, i in zip(mesh.lines, cell)]))
        total += volume * values[MATERIALS[material][2]]
    return total
