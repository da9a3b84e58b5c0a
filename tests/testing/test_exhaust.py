"""The exhaust system and its simulated tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.files.nastran import build_structure, read_deck
from femtune.files.uff import read_uff
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.response import mass_response
from femtune.parameters import ParameterSet
from femtune.units import SI
from structures.exhaust import CLAMP, FRONT, KNOWN, REAR, WHOLE, Noise, exhaust_deck, simulated_tests, write_tests


@pytest.fixture(scope="module")
def deck(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("exhaust") / "exhaust.bdf"
    path.write_text(exhaust_deck().text)
    return path


@pytest.mark.slow
def test_the_parts_and_the_whole_hang_free(deck: Path):
    exhaust = exhaust_deck()
    built = build_structure(read_deck(deck))
    model = parametric_model(built.structure, ParameterSet(()), ())
    clamp = exhaust.elements[CLAMP]
    masses = []
    for off in (exhaust.elements[REAR] + clamp, exhaust.elements[FRONT] + clamp, ()):
        point = configure(model, Configuration(elements_off=frozenset(off))).at(np.zeros(0))
        freq = solve_modes(point, 8).freq_hz
        assert freq[5] < 1e-2
        assert freq[6] > 5.0
        masses.append(mass_response(point).properties.mass)
    assert masses[2] == pytest.approx(masses[0] + masses[1], rel=1e-9)


@pytest.mark.slow
def test_a_tube_weighs_what_it_should(deck: Path):
    """The front's tubes: length along the corners, ring area, density."""
    structure = build_structure(read_deck(deck)).structure
    exhaust = exhaust_deck()
    shells = {int(i) for batch in structure.batches if batch.card == "CQUAD4" for i in batch.ids}
    off = frozenset(set(exhaust.elements[REAR]) | set(exhaust.elements[CLAMP]) | shells)
    point = configure(parametric_model(structure, ParameterSet(()), ()), Configuration(elements_off=off)).at(
        np.zeros(0)
    )
    corners = [[(0, 0, 0.15), (0.10, 0, 0.04), (0.25, 0, 0)], [(0.5, 0, 0), (0.8, 0, -0.05), (1.1, 0, -0.05)]]
    length = sum(float(np.linalg.norm(np.diff(np.array(c, float), axis=0), axis=1).sum()) for c in corners)
    area = np.pi * (0.019**2 - 0.0175**2)
    assert mass_response(point).properties.mass == pytest.approx(7850.0 * area * length, rel=1e-4)


@pytest.mark.slow
def test_the_tests_scatter_as_they_say(deck: Path, tmp_path: Path):
    exhaust = exhaust_deck()
    exact, noisy = (
        simulated_tests(exhaust, deck, 3, noise, step_hz=5.0)
        for noise in (Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), Noise(floor=0.0))
    )
    assert [m.name for m in noisy] == [FRONT, REAR, WHOLE]
    for one, other in zip(exact, noisy):
        shift = other.test.modes.freq_hz / one.test.modes.freq_hz - 1.0
        assert 0.3e-4 < shift.std() < 3e-4
        ratio = other.test.frfs.values / one.test.frfs.values - 1.0
        assert ratio.real.std() == pytest.approx(0.03, rel=0.05)
        assert ratio.imag.std() == pytest.approx(0.03, rel=0.05)
        assert other.weighed == pytest.approx(one.weighed, rel=0.01)
    for one, name in zip(noisy, write_tests(noisy, tmp_path).values()):
        content = read_uff(tmp_path / name, units=SI)
        np.testing.assert_allclose(content.test.modes.freq_hz, one.test.modes.freq_hz, rtol=1e-5)
        assert content.test.frfs.values.shape == one.test.frfs.values.shape


@pytest.mark.slow
def test_light_damping_is_told_by_energy(deck: Path):
    """Damping ratios lie between half the loss factors of what is strained."""
    front = simulated_tests(exhaust_deck(), deck, 0, Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 50.0)[0]
    eta = {k.name: k.truth for k in KNOWN if k.name in ("eta_front", "eta_converter")}
    assert (front.test.modes.damping_ratio > 0.5 * eta["eta_front"]).all()
    assert (front.test.modes.damping_ratio < 0.5 * eta["eta_converter"]).all()
