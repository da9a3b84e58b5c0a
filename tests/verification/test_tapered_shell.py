"""A plate whose thickness triples: CQUAD4 with T1 to T4 beside CalculiX's eight-node shells with nodal thickness."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.loaded import load_module

import femtune as ft

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "10_tapered_shell"


shell8 = load_module(EXAMPLE / "shell8.py")


@pytest.fixture(scope="module")
def source(shared_data: Path) -> Path:
    return shared_data / "calculix_decks"


@pytest.fixture(scope="module")
def calculix() -> str:
    program = os.environ.get("FEMTUNE_CALCULIX") or shutil.which("ccx")
    if program is None:
        pytest.skip("CalculiX is not here: put ccx on the path or its place in $FEMTUNE_CALCULIX")
    return program


def solved(program: str, shell: Any, element: str, folder: Path) -> np.ndarray:
    (folder / "shell.inp").write_text(shell8.calculix_text(shell, 10, element))
    subprocess.run([program, "shell"], cwd=folder, check=True, stdout=subprocess.DEVNULL, timeout=120)
    return shell8.listed_frequencies((folder / "shell.dat").read_text())


def found(shell: Any, folder: Path, card: str = "CQUAD4") -> np.ndarray:
    deck = folder / "shell.bdf"
    deck.write_text(shell8.nastran_text(shell, 10, card))
    (modes,) = ft.modes(deck)
    return np.array(modes.freq_hz[:10])


def test_the_deck_is_understood(source: Path, calculix: str, tmp_path: Path) -> None:
    """Written anew for CalculiX it gives the listed frequencies, digit for digit."""
    listed = shell8.listed_frequencies((source / "shellf.dat.ref").read_text())
    again = solved(calculix, shell8.read_shell8(source / "shellf.inp"), "S8", tmp_path)
    np.testing.assert_allclose(again, listed, rtol=1e-6)


@pytest.mark.slow
def test_frequencies_within_a_percent(source: Path, calculix: str, tmp_path: Path) -> None:
    """Without Poisson's ratio, with which CalculiX's clamped edges converge slowly; ours with the second order."""
    shell = replace(shell8.read_shell8(source / "shellf.inp"), poisson=0.0)
    reference = solved(calculix, shell8.refined(shell, 8), "S8R", tmp_path)
    ours = [found(shell8.refined(shell, n), tmp_path) for n in (4, 8, 16)]
    errors = ours[-1] / reference - 1.0
    assert np.abs(errors).max() < 0.011
    assert np.abs(errors[:6]).max() < 0.01
    steps_between = (ours[0] - ours[1]) / (ours[1] - ours[2])
    assert np.log2(steps_between[:6]).min() > 1.6


@pytest.mark.long
def test_eight_node_shells_on_the_same_mesh(source: Path, calculix: str, tmp_path: Path) -> None:
    """Thickness varies within the elements of both programs; rotary inertia, in CalculiX's alone, is in the 0.25 %."""
    shell = shell8.refined(replace(shell8.read_shell8(source / "shellf.inp"), poisson=0.0), 8)
    theirs = solved(calculix, shell, "S8R", tmp_path)
    np.testing.assert_allclose(found(shell, tmp_path, "CQUAD8"), theirs, rtol=0.003)
