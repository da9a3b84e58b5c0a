"""The table of sensitivities against modes of decks with the value typed in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.deck_models import model_of

import femtune as ft
from femtune.dofs import DofSet
from femtune.files.uff import write_uff_modes
from femtune.modal import ModeSet
from femtune.model import solve_modes
from femtune.testdata import ModalTest, WireFrame
from femtune.units import SI

DECK = """SOL 103
CEND
SPC = 1
METHOD = 7
BEGIN BULK
EIGRL,7,,,2
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
CELAS2,11,{k1},1,1,2,1
CELAS2,12,2000.,2,1,3,1
CONM2,21,2,,{m}
CONM2,22,3,,3.
SPC1,1,123456,1
SPC1,1,23456,2,3
ENDDATA
"""
STUDY = """
[study]
title = "Two masses"
deck = "deck.bdf"
units = "m-kg-s"
[[configuration]]
name = "A"
test = "test.uff"
[sensors]
by_id = true
[[parameter]]
name = "k1"
fields = ["CELAS2 11 K"]
lower = 0.5
upper = 2.0
[[parameter]]
name = "m"
fields = ["CONM2 21 M"]
lower = 0.5
upper = 2.0
[residuals]
frequency_sd = 0.02
frequency_form = "{form}"
"""


def _frequencies(folder: Path, k1: float, m: float) -> tuple[np.ndarray, np.ndarray]:
    path = folder / "typed.bdf"
    path.write_text(DECK.format(k1=repr(float(k1)), m=repr(float(m))))
    solution = solve_modes(model_of(path).at(np.zeros(0)), 2)
    return solution.freq_hz, solution.shapes


def _study(folder: Path, form: str) -> Path:
    freq, shapes = _frequencies(folder, 1500.0, 2.2)
    (folder / "deck.bdf").write_text(DECK.format(k1="1000.", m="2."))
    frame = WireFrame(np.array([2, 3]), np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]))
    modes = ModeSet(freq, shapes, DofSet.parse(["2X+", "3X+"]))
    write_uff_modes(folder / "test.uff", ModalTest("A", SI, frame, modes=modes))
    (folder / "study.toml").write_text(STUDY.format(form=form))
    return folder / "study.toml"


@pytest.mark.slow
def test_percent_per_percent_is_the_logarithmic_derivative(tmp_path: Path) -> None:
    h = 1e-4
    up = np.log(np.array([_frequencies(tmp_path, 1000 * (1 + h), 2)[0], _frequencies(tmp_path, 1000, 2 * (1 + h))[0]]))
    down = np.log(
        np.array([_frequencies(tmp_path, 1000 * (1 - h), 2)[0], _frequencies(tmp_path, 1000, 2 * (1 - h))[0]])
    )
    expected = ((up - down) / (2 * h)).T
    for form in ("frequency", "eigenvalue"):
        found = ft.select(_study(tmp_path, form)).record.sensitivities
        table = np.array([row.percent_per_percent for row in found])
        assert [row.test_label for row in found] == ["1", "2"]
        np.testing.assert_allclose(table, expected, rtol=1e-6)


def test_the_deck_says_how_many_modes_where_the_study_does_not(tmp_path: Path) -> None:
    modes = ft.modes(_study(tmp_path, "frequency"))
    assert len(modes[0].freq_hz) == 2


def test_a_spring_to_the_ground_is_named(tmp_path: Path) -> None:
    deck = DECK.format(k1="1000.", m="2.").replace("CELAS2,11,1000.,1,1,2,1", "CELAS2,11,1000.,2,1")
    (tmp_path / "grounded.bdf").write_text(deck)
    check = ft.info(tmp_path / "grounded.bdf").record.configurations[0].rigid_body_check
    assert check.grounded
    assert check.verdict == "pass"
    assert (
        check.sentence
        == "without supports, rigid-body motion strains only elements that are connected to ground: CELAS2 11"
    )
    assert [(e.card, e.element, e.motion) for e in check.grounding_elements] == [("CELAS2", 11, "X")]


def test_a_spring_across_two_directions_is_a_fault(tmp_path: Path) -> None:
    deck = DECK.format(k1="1000.", m="2.").replace("CELAS2,11,1000.,1,1,2,1", "CELAS2,11,1000.,1,1,2,2")
    (tmp_path / "skew.bdf").write_text(deck)
    check = ft.info(tmp_path / "skew.bdf").record.configurations[0].rigid_body_check
    assert check.verdict == "fail"
    assert {e.element for e in check.grounding_elements} == {11}


def test_mode_sets_hold_the_shapes_at_all_points(tmp_path: Path) -> None:
    modes = ft.modes(_study(tmp_path, "frequency")).mode_sets["A"]
    # mass-normalised by hand: k = [[3000, -2000], [-2000, 2000]], m = diag(2, 3)
    at = [modes.dofs.labels().index(label) for label in ("2X+", "3X+")]
    phi = modes.shapes[at]
    np.testing.assert_allclose(phi.T @ np.diag([2.0, 3.0]) @ phi, np.eye(2), atol=1e-10)
    stiffness = np.array([[3000.0, -2000.0], [-2000.0, 2000.0]])
    np.testing.assert_allclose(phi.T @ stiffness @ phi, np.diag(modes.eigenvalues), atol=1e-6)
    assert modes.normalisation == "mass"
