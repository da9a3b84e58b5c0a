"""A strip of solids bent by a preload, beside CalculiX: its stresses vary within each element."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from tests.model.decks import card
from tests.model.preloaded import RHO, E, eigenvalues, force

N, SIZES, COUNT = 10, (1.0, 0.1, 0.01), 6
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)]
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def strip() -> tuple[dict[int, np.ndarray], list[list[int]], list[int], list[int]]:
    """Points, elements in the order of Nastran, and the points at the clamped and at the loaded end."""
    grid = np.stack(np.meshgrid(*map(np.arange, (2 * N + 1, 3, 3)), indexing="ij"), -1).reshape(-1, 3)
    number = {tuple(g): i + 1 for i, g in enumerate(grid.tolist())}
    elements = []
    for i in range(N):
        at = 2 * (np.array([i, 0, 0]) + CORNERS)
        elements.append([number[tuple(p.tolist())] for p in [*at, *((at[a] + at[b]) // 2 for a, b in EDGES)]])
    used = sorted({n for own in elements for n in own})
    points = {n: grid[n - 1] / [2 * N, 2, 2] * SIZES for n in used}
    ends = [[n for n in used if grid[n - 1, 0] == x] for x in (0, 2 * N)]
    return points, elements, *ends


def by_calculix(folder: Path, load: float) -> np.ndarray:
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if not program:
        pytest.skip("CalculiX is not here: put ccx on the path or its place in $FEMTUNE_CALCULIX")
    points, elements, held, loaded = strip()
    text = "*NODE\n" + "".join(f"{n},{x[0]:.9g},{x[1]:.9g},{x[2]:.9g}\n" for n, x in points.items())
    text += "*ELEMENT,TYPE=C3D20,ELSET=ALL\n"
    for k, own in enumerate(elements):
        order = [*own[:12], *own[16:], *own[12:16]]
        text += f"{k + 1}," + ",".join(map(str, order[:10])) + ",\n" + ",".join(map(str, order[10:])) + "\n"
    text += f"*MATERIAL,NAME=M\n*ELASTIC\n{E},0.\n*DENSITY\n{RHO}\n*SOLID SECTION,ELSET=ALL,MATERIAL=M\n*BOUNDARY\n"
    text += "".join(f"{n},1,3\n" for n in held) + "*STEP\n*STATIC\n*CLOAD\n"
    text += "".join(f"{n},2,{load / len(loaded):.12g}\n" for n in loaded)
    text += f"*END STEP\n*STEP,PERTURBATION\n*FREQUENCY\n{COUNT}\n*END STEP\n"
    (folder / "strip.inp").write_text(text)
    subprocess.run([program, "strip"], cwd=folder, check=True, capture_output=True, timeout=300)
    rows = re.findall(r"^ +\d+ +([\d.E+-]+)(?: +[\d.E+-]+){3} *$", (folder / "strip.dat").read_text(), re.MULTILINE)
    return np.array(rows[:COUNT], float)


@pytest.mark.slow
def test_a_bent_strip_of_quadratic_solids(tmp_path: Path) -> None:
    """One element over the height: with mean stresses the load would have no effect on the lowest mode at all."""
    points, elements, held, loaded = strip()
    load = -0.8 * 4.0126 * E / 6 * np.sqrt(0.1 * 0.01**3 * (0.1 * 0.01**3 * (1 - 0.063)) / 2)
    cards = [card("GRID", n, 0, *map(float, x)) for n, x in points.items()]
    cards += [card("CHEXA", k + 1, 1, *own) for k, own in enumerate(elements)]
    cards += [
        "PSOLID,1,1",
        card("MAT1", 1, E, None, 0.0, RHO),
        "PARAM,COUPMASS,1",
        *(card("SPC1", 1, 123, n) for n in held),
    ]
    ours = eigenvalues(cards, [force(n, (0.0, load / len(loaded), 0.0)) for n in loaded], COUNT)
    free = eigenvalues(cards, [force(loaded[0], (1e-9, 0.0, 0.0))], COUNT)
    assert ours[0] < 0.7 * free[0]
    np.testing.assert_allclose(np.sqrt(ours / by_calculix(tmp_path, load)), 1.0, atol=8e-3)
