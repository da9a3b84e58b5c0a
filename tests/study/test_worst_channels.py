"""[[hold_out]] worst: the worst outputs are the validation set; mistakes of channels are told by a study."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError, Notice
from femtune.residuals.frf.model_way import AtFirstState
from femtune.steps.report_source import ReportSource
from femtune.steps.run.page.short_form import short_form
from femtune.study.study import load_study

from ..messages.shown import check_shown
from .cantilever import EI, Bench
from .damped_cantilever import DAMPED, LABELS, TRULY, functions, study_of

FRF = 'kind = "frf"\ncount = 12\nto_hz = 150.0\n'


def noisy(bench: Bench, size: dict[str, float], **changes: object) -> None:
    """FRFs with a relative noise for some outputs."""
    exact = functions(bench.truth(TRULY, DAMPED))
    rng = np.random.default_rng(3)
    chance = rng.standard_normal((2, *exact.values.shape))
    part = np.array([size.get(label, 1e-4) for label in LABELS])[:, None, None]
    bench.functions(replace(exact, values=exact.values * (1.0 + part * (chance[0] + 1j * chance[1])), **changes))


def study(bench: Bench, hold: str) -> Path:
    return study_of(bench, f"{FRF}\n[[hold_out]]\n{hold}\n", EI)


def test_the_noisiest_output_is_held_out(bench: Bench) -> None:
    noisy(bench, {"5Y+": 0.05})
    found = load_study(study(bench, "worst = 1"))
    (case,) = found.cases
    assert case.test is not None
    assert case.test.frfs is not None
    assert {case.test.frfs.responses.labels()[i] for i, _ in case.held.functions} == {"5Y+"}
    assert len(case.held.functions) == 2
    (notice,) = [n for n in found.notices if n.code == "study.worst-held"]
    assert "1 of 3 outputs" in notice.what
    assert ": 5Y+ (0.04" in notice.what
    numbers = {"first": 0.048, "last": 0.048, "rest_first": 0.0021, "rest_last": 0.0002}
    check_shown("study.worst-held", Notice(notice.code, level="info", **{**notice.facts, **numbers}))


@pytest.mark.slow
def test_the_input_of_a_hammer_that_roves_which_an_identified_system_fits_worst_is_held_out(bench: Bench) -> None:
    exact = functions(bench.truth(TRULY, DAMPED), outputs=("3Y+",), inputs=("3Y+", "4Y+", "5Y+"))
    chance = np.random.default_rng(3).standard_normal((2, *exact.values.shape))
    part = np.array([1e-4, 0.05, 1e-4])[None, :, None]
    bench.functions(replace(exact, values=exact.values * (1.0 + part * (chance[0] + 1j * chance[1]))))
    found = load_study(study(bench, 'worst = 1\nby = "fit"'))
    assert found.cases[0].held.functions == {(0, 1)}
    (notice,) = [n for n in found.notices if n.code == "study.worst-held"]
    assert "the largest error of the identified system" in notice.what
    assert "1 of 3 inputs" in notice.what


@pytest.mark.slow
def test_the_output_that_an_identified_system_fits_worst_is_held_out(bench: Bench) -> None:
    noisy(bench, {"3Y+": 0.05})
    found = load_study(study(bench, 'worst = 1\nby = "fit"'))
    (case,) = found.cases
    assert case.test is not None
    assert case.test.frfs is not None
    assert {case.test.frfs.responses.labels()[i] for i, _ in case.held.functions} == {"3Y+"}
    (notice,) = [n for n in found.notices if n.code == "study.worst-held"]
    assert "the largest error of the identified system" in notice.what


def test_the_noisiest_input_is_held_out_where_one_output_was_measured(bench: Bench) -> None:
    exact = functions(bench.truth(TRULY, DAMPED), outputs=("3Y+",), inputs=("3Y+", "4Y+", "5Y+"))
    chance = np.random.default_rng(3).standard_normal((2, *exact.values.shape))
    part = np.array([1e-4, 0.05, 1e-4])[None, :, None]
    bench.functions(replace(exact, values=exact.values * (1.0 + part * (chance[0] + 1j * chance[1]))))
    found = load_study(study(bench, "worst = 1"))
    (case,) = found.cases
    assert case.held.functions == {(0, 1)}
    (notice,) = [n for n in found.notices if n.code == "study.worst-held"]
    assert "1 of 3 inputs" in notice.what
    assert ": 4Y+ (0.05" in notice.what
    with pytest.raises(FemtuneError, match="3 inputs should be held out"):
        load_study(study(bench, "worst = 3"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hold", "says"),
    [
        ("worst = 3", "3 outputs should be held out"),
        ('worst = 1\nby = "coherence"', "have no coherence"),
        ('outputs = ["5Y+"]\nby = "noise"', "by applies to worst"),
        ('outputs = ["5Y+"]\nworst = 1', "and names outputs or inputs too"),
    ],
)
def test_what_cannot_be_held_out(bench: Bench, hold: str, says: str) -> None:
    noisy(bench, {})
    with pytest.raises(FemtuneError) as error:
        load_study(study(bench, hold))
    assert error.value.code == "study.hold-out"
    assert says in error.value.what


@pytest.mark.slow
def test_a_wrong_sign_a_dead_channel_and_a_driving_point_are_told(bench: Bench) -> None:
    exact = functions(bench.truth(TRULY, DAMPED), 0.001)
    values = exact.values.copy()
    values[0] *= -1.0
    values[2, 0] = 0.0
    values[1, 0] = np.conj(values[1, 0])
    bench.functions(replace(exact, values=values))
    found = load_study(study_of(bench, FRF, EI))
    codes = {n.code for n in found.notices}
    assert "frf.driving-point" in codes or "frf.kind-contradicts" in codes
    dead = exact.values.copy()
    dead[0] *= 1e-9
    bench.functions(replace(exact, values=dead))
    found = load_study(study_of(bench, FRF, EI))
    (notice,) = [n for n in found.notices if n.code == "frf.dead"]
    assert "3Y+" in notice.what


def test_a_wrong_sign_is_told_once_the_model_is_solved(bench: Bench) -> None:
    exact = functions(bench.truth(TRULY, DAMPED), 0.001, outputs=("2Y+", "3Y+", "4Y+", "5Y+"), inputs=("5Y+",))
    sign = np.array([1.0, -1.0, 1.0, 1.0])[:, None, None]
    bench.functions(replace(exact, values=sign * exact.values))
    found = load_study(study_of(bench, FRF, EI))
    problem = found.problem()
    problem.start(np.zeros(2))
    (residual,) = problem.cases[0].residuals
    assert isinstance(residual, AtFirstState)
    (notice,) = [n for n in residual.notices if n.code == "residual.frf-sign"]
    assert "output 3Y+ are opposite" in notice.what


@pytest.mark.slow
def test_the_terminal_names_the_held_outputs(bench: Bench) -> None:
    noisy(bench, {"5Y+": 0.05})
    run = ft.run(study(bench, "worst = 1"))
    assert ": 5Y+ (" in str(short_form(ReportSource(run.results, run.arrays)))


@pytest.mark.slow
@pytest.mark.parametrize("equalised", ["", "[equalise]\ndamping = 0.02\n"])
def test_a_band_without_lines_is_told_before_anything_is_solved(bench: Bench, equalised: str) -> None:
    noisy(bench, {})
    text = FRF.replace("to_hz = 150.0", "from_hz = 900.0\nto_hz = 950.0")
    with pytest.raises(FemtuneError) as error:
        load_study(study_of(bench, f"{text}\n{equalised}", EI))
    assert error.value.code == "residual.no-frf-lines"
    assert error.value.where is not None
