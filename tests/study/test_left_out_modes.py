"""`leave_out_modes_hz`: a mode of the model that the test does not show is left out of the compared FRFs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.deck_models import model_of

import femtune as ft
from femtune.errors import FemtuneError, Notice
from femtune.model import ConfiguredModel, constant_damping, solve_modes
from femtune.model.response import frf_gradient, make_ports
from femtune.steps.run.result import RunResult

from ..messages.shown import check_shown
from .cantilever import CANTILEVER, EI, TRUE, Bench

LINES, RATIO, SECOND = np.arange(10.0, 400.0, 2.0), 0.02, 1
"""Lines in Hz, damping, and which of the modes that bend in the plane of the test is not in it."""


def _model(bench: Bench, deck: Path | None = None) -> ConfiguredModel:
    path = deck or bench.write("beam.bdf", CANTILEVER)
    return model_of(path)


def _missing(bench: Bench, deck: Path | None = None) -> tuple[int, float]:
    """Position and frequency of the mode."""
    model = _model(bench, deck)
    solved = solve_modes(model.at(np.zeros(0)), 20)
    seen = np.abs(make_ports(model, ["5Y+"], ["5Y+"]).outputs @ solved.shapes[:, :20]).ravel()
    at = int(np.flatnonzero(seen > 0.1 * seen.max())[SECOND])
    return at, float(solved.freq_hz[at])


def _measured(bench: Bench) -> None:
    """Functions of the true beam without that mode."""
    deck = bench.truth(TRUE, CANTILEVER)
    model = _model(bench, deck)
    ports = make_ports(model, ["5Y+"], ["2Y+", "3Y+", "4Y+", "5Y+"])
    found = frf_gradient(
        solve_modes(model.at(np.zeros(0)), 20), ports, LINES, damping=constant_damping(RATIO),
        left_out=[_missing(bench, deck)[0]],
    ).frfs  # fmt: skip
    bench.functions(replace(found, coherence=None))


def _study(bench: Bench, more: str, after: str = "") -> Path:
    bench.write("beam.bdf", CANTILEVER)
    residual = f'[[residual]]\nkind = "frf"\nratio = {RATIO}\n{more}\n'
    return bench.study(f"{EI}\n{residual}\n{after}", test="frfs.uff")


def _values(run: RunResult) -> dict[str, float]:
    assert run.results.update is not None
    return {p.name: p.value for p in run.results.update.parameters}


@pytest.mark.slow
@pytest.mark.parametrize("after", ["", pytest.param("[reduction]\n", marks=pytest.mark.long)])
def test_the_truth_is_found_without_the_mode_that_the_test_lacks(bench: Bench, after: str) -> None:
    _measured(bench)
    number, hertz = _missing(bench)
    run = ft.run(_study(bench, f"leave_out_modes_hz = [{1.01 * hertz}]", after))
    update = run.results.update
    assert update is not None
    assert update.ok
    assert _values(run) == pytest.approx({"root": 1.3, "tip": 0.85}, rel=2e-3)
    (one,) = update.left_out_modes
    assert (one.before, one.before_hz) == (1 + number, pytest.approx(hertz))
    true_number, true_hz = _missing(bench, bench.truth(TRUE, CANTILEVER))
    assert (one.after, one.after_hz) == (1 + true_number, pytest.approx(true_hz, rel=1e-3))
    assert one.correlation > 0.95
    (told,) = [a for a in run.results.alerts if a.code == "residual.frf-left-out-modes"]
    assert f"model mode {1 + number} ({hertz:.4g} Hz) is left out" in told.sentence
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "Modes that are left out of the FRFs of the model" in page
    # with the mode, the model cannot be right
    other = ft.run(_study(bench, "", after))
    assert max(abs(_values(other)[n] / v - 1.0) for n, v in (("root", 1.3), ("tip", 0.85))) > 0.02


@pytest.mark.slow
def test_a_frequency_far_from_all_modes(bench: Bench) -> None:
    _measured(bench)
    number, hertz = _missing(bench)
    with pytest.raises(FemtuneError) as caught:
        ft.run(_study(bench, f"leave_out_modes_hz = [{1.05 * hertz:.5g}]"))
    check_shown("residual.left-out-mode", str(caught.value).replace(str(bench.folder), "folder"))
    assert number
    (told,) = ft.check(bench.folder / "study.toml").errors
    assert str(told) == str(caught.value)


@pytest.mark.slow
def test_one_mode_is_named_once(bench: Bench) -> None:
    _measured(bench)
    _, hertz = _missing(bench)
    with pytest.raises(FemtuneError) as caught:
        ft.run(_study(bench, f"leave_out_modes_hz = [{hertz}, {1.001 * hertz}]"))
    assert caught.value.code == "residual.left-out-mode"
    (told,) = ft.check(bench.folder / "study.toml").errors
    assert str(told) == str(caught.value)


@pytest.mark.slow
def test_the_check_accepts_modes_of_the_model(bench: Bench) -> None:
    _measured(bench)
    study = _study(bench, f"leave_out_modes_hz = [{_missing(bench)[1]}]")
    assert ft.check(study).ok


def test_other_methods_have_no_terms_of_real_modes(bench: Bench) -> None:
    _measured(bench)
    with pytest.raises(FemtuneError) as caught:
        ft.run(_study(bench, 'leave_out_modes_hz = [50.0]\nmethod = "direct"'))
    check_shown("study.left-out-modes", str(caught.value).replace(str(bench.folder), "folder"))


def test_what_the_notices_say() -> None:
    which = "model modes 9 (62.04 Hz), 10 (62.19 Hz) are"
    notice = Notice("residual.frf-left-out-modes", level="info", configuration="mass-loaded", modes=which)
    check_shown("residual.frf-left-out-modes", notice)
    lost = Notice(
        "residual.left-out-mode-lost", configuration="mass-loaded", before=9, before_hz=62.04, after=11,
        after_hz=65.5, correlation=0.41,
    )  # fmt: skip
    check_shown("residual.left-out-mode-lost", lost)
