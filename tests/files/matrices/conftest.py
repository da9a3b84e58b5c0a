"""A job that CalculiX solves, with its matrices."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

_NX, _NY = 8, 2


def ccx_beam(nx: int = _NX, ny: int = _NY) -> str:
    """A cantilever of C3D20 elements, 2 m long."""
    lines, number, count = ["*NODE, NSET=ALL"], {}, 0
    for i in range(2 * nx + 1):
        for j in range(2 * ny + 1):
            for k in range(3):
                if (i % 2) + (j % 2) + (k % 2) <= 1:
                    count += 1
                    number[i, j, k] = count
                    lines.append(f"{count},{i / nx},{0.1 * j / ny},{0.06 * k}")
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=E")
    corner = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    for e, (i, j) in enumerate(np.ndindex(nx, ny), 1):
        at = [(2 * i + a, 2 * j + b, c) for a, b, c in corner]
        at += [tuple((np.array(at[a]) + at[b]) // 2) for a, b in edges]
        ids = [number[tuple(map(int, p))] for p in at]
        lines += [f"{e}," + ",".join(map(str, ids[:10])) + ",", ",".join(map(str, ids[10:]))]
    held = [n for (i, _, _), n in number.items() if i == 0]
    lines += ["*MATERIAL,NAME=S", "*ELASTIC", "2.1e11,.3", "*DENSITY", "7800.", "*SOLID SECTION,ELSET=E,MATERIAL=S"]
    lines += ["*BOUNDARY", *(f"{n},1,3" for n in held)]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="session")
def calculix_job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with beam.sti, .mas, .dof and .inp of CalculiX, and its listed frequencies in modes.dat."""
    ccx = shutil.which("ccx")
    if ccx is None:
        pytest.skip("CalculiX (ccx) is not installed")
    folder = tmp_path_factory.mktemp("ccx")
    for name, card in (("beam", "*FREQUENCY, SOLVER=MATRIXSTORAGE"), ("modes", "*FREQUENCY")):
        (folder / f"{name}.inp").write_text(ccx_beam() + f"*STEP\n{card}\n10\n*END STEP\n")
        subprocess.run([ccx, name], cwd=folder, check=True, capture_output=True, timeout=120)
    return folder
