"""A wing of membranes, rods and masses whose first mode commercial Nastran lists: nothing of it has drilling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.files.nastran import build_structure, read_deck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet
from structures.goland_wing import LISTED_HZ, goland_wing


def modes(path: Path, text: str) -> np.ndarray:
    path.write_text(text)
    structure = build_structure(read_deck(path)).structure
    configured = configure(parametric_model(structure, ParameterSet(()), ()), Configuration(support_set=1))
    return solve_modes(configured.at(np.zeros(0)), 7).freq_hz


@pytest.mark.slow
def test_the_listed_mode_of_the_goland_wing(tmp_path: Path) -> None:
    """Seven digits, and the listed Sturm counts: four modes below 13.30429 Hz, six below 18.98444 Hz."""
    found = modes(tmp_path / "wing.bdf", goland_wing())
    np.testing.assert_allclose(found[0], LISTED_HZ, rtol=3e-7)
    assert ((found < 13.30429).sum(), (found < 18.98444).sum()) == (4, 6)
    np.testing.assert_array_equal(modes(tmp_path / "other.bdf", goland_wing("PARAM,K6ROT,1.+4\n")), found)


@pytest.mark.slow
def test_a_shell_that_bends_brings_drilling_to_all(tmp_path: Path) -> None:
    """With bending of the skins K6ROT acts again: a hundred times as much of it is seen in the modes."""
    bent = [goland_wing(f"PARAM,K6ROT,{k}\n").replace("PSHELL,1,1,0.0155", "PSHELL,1,1,0.0155,1") for k in (1.0, 1e4)]
    first, second = (modes(tmp_path / f"{i}.bdf", text) for i, text in enumerate(bent))
    assert np.abs(second / first - 1.0).max() > 1e-4
