"""The same mesh for CalculiX, solved by its own program."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from structures.solids import SolidMesh

YOUNG, POISSON, DENSITY = 210e9, 0.3, 7850.0

# Nastran lists the middles of bottom, upright and top sides, CalculiX those of the bottom, the top and upright
TYPES = {
    "hexa20": ("C3D20", [*range(12), *range(16, 20), *range(12, 16)]),
    "penta15": ("C3D15", [*range(9), *range(12, 15), *range(9, 12)]),
    "tetra10": ("C3D10", [*range(10)]),
}


def input_text(mesh: SolidMesh, clamped: str, modes: int) -> str:
    """A frequency step."""
    kind, order = TYPES[mesh.kind]
    lines = ["*NODE, NSET=ALL", *(_line(i, place) for i, place in enumerate(mesh.xyz))]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=EALL")
    for i, cell in enumerate(mesh.cells[:, order]):
        numbers = [i + 1, *(cell + 1)]
        # at most sixteen entries a line
        rows = [numbers[k : k + 10] for k in range(0, len(numbers), 10)]
        lines += [*(", ".join(map(str, row)) + "," for row in rows[:-1]), ", ".join(map(str, rows[-1]))]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG:g}, {POISSON:g}", "*DENSITY", f"{DENSITY:g}"]
    lines += ["*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL"]
    lines += ["*NSET, NSET=CLAMPED", *(f"{n + 1}," for n in mesh.face(clamped)), "*BOUNDARY", "CLAMPED, 1, 3"]
    lines += ["*STEP", "*FREQUENCY", str(modes), "*NODE FILE", "U", "*END STEP", ""]
    return "\n".join(lines)


def _line(i: int, place: NDArray) -> str:
    return f"{i + 1}, " + ", ".join(f"{x:.12g}" for x in place)


def solve(program: str, mesh: SolidMesh, clamped: str, modes: int, folder: Path) -> NDArray[np.float64]:
    """Natural frequencies in Hz."""
    (folder / "solid.inp").write_text(input_text(mesh, clamped, modes))
    subprocess.run([program, "solid"], cwd=folder, check=True, stdout=subprocess.DEVNULL, timeout=600)
    rows = re.findall(r"^\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)\s*$", (folder / "solid.dat").read_text(), re.M)
    return np.array([float(cycles) for _, _, cycles, _ in rows[:modes]])
