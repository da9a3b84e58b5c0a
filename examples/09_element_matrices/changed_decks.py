"""Two decks of others with finer meshes, written to a folder of our own."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SOLID_DECK = "static_solid_shell_bar_kelm.bdf"
MODES_DECK = "mode_solid_shell_bar.bdf"
SHEET_DECK = "random_test_bar_plus_tri.bdf"
PLATE_DECK = "plate_py.dat"


def cards(text: str) -> list[tuple[list[str], str]]:
    """Fields of the first line of each card, and all its lines with those of comments after it."""
    found: list[tuple[list[str], str]] = []
    for line in text.splitlines(keepends=True):
        if found and line[:1] in (" ", ",", "$", "+", "\n", "\t"):
            found[-1] = (found[-1][0], found[-1][1] + line)
        else:
            found.append((re.split(r"[,\s]+", line.strip()), line))
    return found


def refined(source: Path, folder: Path, n: int) -> Path:
    """The deck of one square and one triangle beside a row of bars, with n elements along every unit of length."""
    mesh = ("GRID", "CBAR", "CQUAD4", "CTRIA3")
    kept = "".join(lines for fields, lines in cards((source / SHEET_DECK).read_text()) if fields[0] not in mesh)
    points: dict[tuple[int, int], int] = {(0, 0): 1}
    corners: list[list[tuple[int, int]]] = []
    lines = [[(0, i), (0, i + 1)] for i in range(4 * n)]
    for j in range(2 * n, 4 * n):
        # the square lies between y = 2 and 3, the triangle above it has its right angle at (0, 3)
        for i in range(min(n, 4 * n - j)):
            square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            corners += [square] if j < 3 * n or i + j + 2 <= 4 * n else [[square[0], square[1], square[3]]]
    for point in (p for element in (*lines, *corners) for p in element):
        points.setdefault(point, len(points) + 1)
    text = [f"GRID,{number},,{x / n!r},{y / n!r},0." for (x, y), number in points.items()]
    text += [f"CBAR,{k},1,{points[a]},{points[b]},1.,0.,0." for k, (a, b) in enumerate(lines, 101)]
    for k, corner in enumerate(corners, 4 * n + 101):
        name = "CQUAD4" if len(corner) == 4 else "CTRIA3"
        text.append(",".join(map(str, [name, k, 3, *(points[p] for p in corner)])))
    path = folder / f"refined_{n}.bdf"
    path.write_text(re.sub(r"(?i)enddata", "\n".join(text) + "\nENDDATA", kept))
    return path


def split_plate(source: Path, folder: Path, xyz: NDArray[np.float64], quads: NDArray[np.int64], n: int) -> Path:
    """The deck of a plate with each of its quadrilaterals, corners `quads` (e, 4) of `xyz`, split into n × n."""
    kept = [lines for fields, lines in cards((source / PLATE_DECK).read_text()) if fields[0] not in ("GRID", "CQUAD4")]
    points: dict[tuple[float, ...], int] = {}

    def number(corners: NDArray[np.float64], u: float, v: float) -> str:
        place = np.array([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v]) @ corners
        return str(points.setdefault(tuple((np.round(place, 9) + 0.0).tolist()), len(points) + 1))

    elements = []
    for corners in xyz[quads]:
        for i in range(n):
            for j in range(n):
                square = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                elements.append("1," + ",".join(number(corners, a / n, b / n) for a, b in square))
    rows = [f"GRID,{k},,{x:.6f},{y:.6f},{z:.6f}" for (x, y, z), k in points.items()]
    rows += [f"CQUAD4,{k},{element}" for k, element in enumerate(elements, 1)]
    path = folder / f"plate_{n}.bdf"
    path.write_text(re.sub(r"(?i)enddata", "\n".join(rows) + "\nENDDATA", "".join(kept)))
    return path
