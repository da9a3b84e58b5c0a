"""CalculiX on the same mesh: its own elements (C3D8I) and assembly, ARPACK on SPOOLES."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stages import Stages
from workspace import Workspace

from cases import MODES
from structures.meshed import MeshedStructure

_ROW = re.compile(r"^\s+\d+\s+(\S+)\s+(\S+)\s+(\S+)\s+(\S+)\s*$", re.M)


def program() -> str | None:
    """Where CalculiX is: FEMTUNE_CALCULIX, or ccx on the path."""
    return os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")


def run(space: Workspace, shift: float | None) -> dict[str, Any]:
    """The whole program, from its input to its list of frequencies."""
    found = program()
    assert found is not None
    stages = Stages()
    write_input(space.case.generate(space.facts["size"]), space.folder / "solid.inp")
    with stages.stage("50 modes, reading and assembly too"):
        subprocess.run([found, "solid"], cwd=space.folder, check=True, stdout=subprocess.DEVNULL)
    freq = _frequencies(space.folder / "solid.dat")
    wrong = "" if len(freq) == MODES else f"{len(freq)} frequencies in its list"
    return {"stages": stages.measured, "freq_hz": [freq], "wrong": wrong}


def _frequencies(listed: Path) -> list[float]:
    """Hz; the list of eigenvalues comes first, with real and imaginary parts of frequencies as its last columns."""
    rows = _ROW.findall(listed.read_text())[:MODES]
    return [float(cycles) for _, _, cycles, _ in rows]


def write_input(structure: MeshedStructure, path: Path) -> None:
    """Nodes, elements by part, materials, and a frequency step that writes frequencies and displacements."""
    with path.open("w", encoding="ascii") as out:
        out.writelines(_lines(structure))


def _lines(structure: MeshedStructure) -> Iterator[str]:
    yield "*NODE, NSET=NALL\n"
    for number, place in zip(structure.node_ids.tolist(), structure.xyz.tolist()):
        yield f"{number}, {place[0]:.12g}, {place[1]:.12g}, {place[2]:.12g}\n"
    for batch in structure.elements:
        yield f"*ELEMENT, TYPE=C3D8I, ELSET=P{batch.property}\n"
        yield from _rows(batch.ids, structure.node_ids[batch.rows])
    for entry in structure.properties:
        material = next(m for m in structure.materials if m.id == entry.material)
        yield f"*MATERIAL, NAME=M{entry.id}\n*ELASTIC\n{material.E:.12g}, {material.nu:.12g}\n"
        yield f"*DENSITY\n{material.rho:.12g}\n*SOLID SECTION, ELSET=P{entry.id}, MATERIAL=M{entry.id}\n"
    yield f"*STEP\n*FREQUENCY\n{MODES}\n*NODE FILE\nU\n*END STEP\n"


def _rows(ids: NDArray[np.int64], nodes: NDArray[np.int64]) -> Iterator[str]:
    for number, cell in zip(ids.tolist(), nodes.tolist()):
        yield ", ".join(map(str, (number, *cell))) + "\n"
