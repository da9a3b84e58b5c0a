"""The subframe with parameters: its masses on the mounts are those of the loaded deck, its truths lie in the bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.files.nastran import build_structure, read_deck
from femtune.model import solve_modes
from structures.shells import natural_frequencies
from structures.subframe import write_subframe
from structures.subframe_campaign import LOADED, SCATTER, Laboratory, half_width


@pytest.mark.slow
def test_masses_of_the_configuration_are_those_of_the_loaded_deck(tmp_path: Path) -> None:
    lab = Laboratory(5_000)
    deck = write_subframe(lab.mesh, tmp_path / "loaded.bdf", "loaded")
    exact = natural_frequencies(build_structure(read_deck(deck)).structure, 20)
    found = solve_modes(lab.configured[LOADED.name].at(lab.origin), 20).freq_hz
    np.testing.assert_allclose(found[6:], np.asarray(exact)[6:20], rtol=1e-6)


@pytest.mark.parametrize("parameters", [9, 15])
def test_truths_differ_between_components_and_lie_within_the_scatter(parameters: int) -> None:
    lab = Laboratory(5_000, parameters)
    truths = [lab.truth(i) for i in range(3)]
    limits = SCATTER * np.array([half_width(name) for name in lab.names])
    assert len(lab.names) == parameters
    assert all((np.abs(x) <= limits).all() for x in truths)
    assert min(np.abs(truths[0] - truths[1]).max(), np.abs(truths[1] - truths[2]).max()) > 0.01
