"""The same mesh for CalculiX, with eight-node shells, solved by its own program."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
from meshes import Mesh
from numpy.typing import NDArray

YOUNG, POISSON, DENSITY = 70e9, 0.33, 2700.0


def input_text(mesh: Mesh, clamped: list[int], modes: int) -> str:
    """A frequency step with elements S8R."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in enumerate(mesh.xyz)]
    for group in mesh.groups:
        lines.append(f"*ELEMENT, TYPE=S8R, ELSET={group.upper()}")
        chosen = [i for i, g in enumerate(mesh.group_of) if g == group]
        lines += [f"{i + 1}, " + ", ".join(map(str, mesh.quads[i])) for i in chosen]
    lines += ["*MATERIAL, NAME=ALU", "*ELASTIC", f"{YOUNG:g}, {POISSON:g}", "*DENSITY", f"{DENSITY:g}"]
    for group, thickness in mesh.groups.items():
        lines += [f"*SHELL SECTION, ELSET={group.upper()}, MATERIAL=ALU", f"{thickness:g}"]
    lines += ["*NSET, NSET=CLAMPED", *(f"{n}," for n in clamped), "*BOUNDARY", "CLAMPED, 1, 6"]
    lines += ["*STEP", "*FREQUENCY", str(modes), "*NODE FILE", "U", "*END STEP", ""]
    return "\n".join(lines)


def solve(program: str, mesh: Mesh, clamped: list[int], modes: int, folder: Path, name: str) -> NDArray[np.float64]:
    """Natural frequencies in Hz."""
    (folder / f"{name}.inp").write_text(input_text(mesh, clamped, modes))
    subprocess.run([program, name], cwd=folder, check=True, stdout=subprocess.DEVNULL, timeout=600)
    rows = re.findall(r"^\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)\s*$", (folder / f"{name}.dat").read_text(), re.M)
    return np.array([float(cycles) for _, _, cycles, _ in rows[:modes]])
