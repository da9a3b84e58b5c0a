"""Intervals of parameters from repeats whose close modes change places: the frequencies are compared by their order."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest

import femtune as ft

LOWER, UPPER = np.array([0.92, 0.9, 0.93]), np.array([1.06, 1.1, 1.07])
STUDY = """
[study]
title = "close modes"
deck = "d.bdf"
units = "m-kg-s"
[test]
file = "t.uff"
[residuals]
frequency_sd = 0.01
[modes]
count = 3
[quantify]
repeats = "rep.csv"
intervals = true
"""
_PARAMETER = '[[parameter]]\nname = "k{i}"\nfields = ["CELAS2 {i} K"]\nlower = 0.5\nupper = 2.0\n'


def frequencies(k: np.ndarray, masses: list[float]) -> np.ndarray:
    """(3,) Hz of a heavy mass between two light ones, which a fourth spring of 1 N/m joins."""
    a, b, c = k * [10.0, 2.0, 2.0]
    stiffness = np.array([[b + 1.0, -b, -1.0], [-b, a + b + c, -c], [-1.0, -c, c + 1.0]])
    return np.sqrt(np.linalg.eigvalsh(stiffness / np.sqrt(np.outer(masses, masses)))) / (2.0 * np.pi)


def deck(masses: list[float]) -> str:
    points = "".join(f"GRID,{i},,{i}.,0.,0.,,23456\n" for i in (1, 2, 3))
    cards = "".join(f"CONM2,{10 + i},{i},,{mass}\n" for i, mass in enumerate(masses, start=1))
    springs = "CELAS2,1,10.,2,1\nCELAS2,2,2.,1,1,2,1\nCELAS2,3,2.,2,1,3,1\nCELAS2,4,1.,1,1,3,1\n"
    return f"SOL 103\nCEND\nMETHOD=1\nBEGIN BULK\nEIGRL,1,,,3\n{points}{cards}{springs}ENDDATA\n"


@pytest.mark.slow
@pytest.mark.parametrize("light", [1.03, 1.06])
def test_the_box_of_the_repeats_is_found(tmp_path: Path, light: float) -> None:
    """Modes that were followed by their motions gave a box that is 0.05 off, and none within the iterations."""
    masses = [1.0, 4.5, light]
    (tmp_path / "d.bdf").write_text(deck(masses))
    ft.write_test(ft.simulate(tmp_path / "d.bdf", ["1 THRU 3:1"], units="m-kg-s", count=3), tmp_path / "t.uff")
    shares = [*product([0.0, 1.0], repeat=3), *np.random.default_rng(3).uniform(size=(10, 3))]
    rows = np.array([frequencies(LOWER + np.array(s) * (UPPER - LOWER), masses) for s in shares])
    # the second and the third frequency overlap: neither column is a motion of its own
    assert rows[:, 1].max() > rows[:, 2].min()
    np.savetxt(tmp_path / "rep.csv", rows, delimiter=",", header="1,2,3", comments="")
    (tmp_path / "s.toml").write_text(STUDY + "".join(_PARAMETER.format(i=i) for i in (1, 2, 3)))
    box = ft.quantify(tmp_path / "s.toml").record.intervals
    assert box.ok
    assert box.proven
    assert "in ascending order" in box.sentence
    found = np.array([[p.lower, p.upper] for p in box.parameters])
    np.testing.assert_allclose(found, np.column_stack([LOWER, UPPER]), atol=4e-3)
