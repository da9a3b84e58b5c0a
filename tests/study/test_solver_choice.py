"""Solvers that are chosen by name: refused before anything is read where they are not there, told where they ran."""

from __future__ import annotations

from pathlib import Path

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from structures import subframe

from .cantilever import CANTILEVER


@pytest.mark.parametrize("step", ["info", "modes", "correlate", "select", "update", "run", "respond"])
@pytest.mark.parametrize("variable", ["FEMTUNE_SOLVER", "FEMTUNE_EIGENSOLVER"])
def test_a_solver_that_is_none_is_refused_before_anything_is_read(
    monkeypatch: pytest.MonkeyPatch, step: str, variable: str
) -> None:
    monkeypatch.setenv(variable, "Pardisso")
    with pytest.raises(FemtuneError) as caught:
        getattr(ft, step)("there-is-no-such-file.toml")
    assert caught.value.code == "solver.unavailable"


def test_slepc_that_is_not_there_is_refused_before_anything_is_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("FEMTUNE_EIGENSOLVER", "slepc")
    monkeypatch.setenv("FEMTUNE_SLEPC_PYTHON", str(tmp_path / "python"))
    with pytest.raises(FemtuneError) as caught:
        ft.modes("there-is-no-such-file.bdf")
    assert caught.value.code == "slepc.not-installed"


def test_modes_tell_who_solved_them(tmp_path: Path) -> None:
    deck = tmp_path / "a.bdf"
    deck.write_text(CANTILEVER)
    (small,) = ft.modes(deck)
    assert small.solver == "dense"


@pytest.mark.slow
def test_sparse_modes_tell_their_sparse_solver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("FEMTUNE_SOLVER", "SuperLU")
    deck = tmp_path / "a.bdf"
    subframe.main(["5000", str(deck)])
    results = ft.modes(deck, report=tmp_path / "page.html", count=4).results
    assert results.modes[0].solver == "block Lanczos, sparse factors by SuperLU"
    assert results.provenance.eigen_solver == results.modes[0].solver
    assert "block Lanczos, sparse factors by SuperLU" in (tmp_path / "page.html").read_text()
