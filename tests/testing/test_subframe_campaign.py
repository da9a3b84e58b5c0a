"""The subframe with parameters: its masses on the mounts are those of the loaded deck, its truths lie in the bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from femtune.files.nastran import build_structure, read_deck
from femtune.model import solve_modes
from structures.shells import natural_frequencies
from structures.subframe import write_subframe
from structures.subframe_campaign import (
    FREE,
    LOADED,
    SCATTER,
    ZETA_RUBBER,
    ZETA_STEEL,
    Laboratory,
    Measured,
    half_width,
)


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


@pytest.mark.slow
def test_damping_is_uneven_and_that_of_rubber_where_rubber_moves() -> None:
    lab = Laboratory(5_000)
    solved = solve_modes(lab.configured[LOADED.name].at(lab.truth(0)), 24)
    ratios = lab.damping(solved, 0)[6:24]
    assert ratios.min() > ZETA_STEEL[0]
    assert ratios.max() < ZETA_RUBBER
    # the lowest modes are those of the masses on the rubber, which holds nearly all of their energy
    np.testing.assert_allclose(ratios[:4], ZETA_RUBBER, rtol=0.01)
    assert ratios.max() / ratios.min() > 1.5


@pytest.mark.slow
def test_noise_of_a_test_is_as_stated() -> None:
    lab = Laboratory(5_000)
    quiet, loud = (lab.test(FREE, 0, Measured((150.0, 200.0), 0.5, *noise)) for noise in ((0.0, 0.0), (0.02, 0.001)))
    size = np.abs(quiet.values)
    scaled = (loud.values - quiet.values) / np.hypot(0.02 * size, 0.001 * size.max(axis=2, keepdims=True))
    parts = np.concatenate([scaled.real.ravel(), scaled.imag.ravel()])
    # χ² at a significance of 1e-4 on either side
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], len(parts))
    assert low < (parts**2).sum() < high
