"""Screening, search and candidates on an external solver and on a table of runs; nothing is run twice."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.journal.run_files import HOLDING
from femtune.steps import all_steps
from femtune.steps.run_lock import LOCK_FILE, locked

from .runs_of_chain import prepared as prepared_table
from .two_masses import TRUTH, exact, prepared, started, write_study


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return prepared(tmp_path)


@pytest.fixture
def table_study(tmp_path: Path) -> Path:
    return prepared_table(tmp_path)


def modes_at(k1: float, k2: float) -> np.ndarray:
    """Frequencies of the masses 1 and 2, in the order of the masses: how they are followed by their shapes."""
    hz, shapes = exact(k1, k2)
    return hz[np.argmax(np.abs(shapes), axis=1)]


@pytest.mark.slow
def test_a_screening_runs_each_point_of_the_design_once_and_follows_modes(study: Path) -> None:
    found = ft.screen(study)
    # nine points; the initial values are none of them
    assert started(study) == 1 + 9
    table = found.arrays["screen_runs"]
    # the initial values are 800 and 1000: mode 1 is that of the first mass
    np.testing.assert_allclose(np.sort(table[:, 2:]), [exact(*row[:2])[0] for row in table], rtol=1e-5)
    # with equal springs both masses move in both modes
    apart = table[np.abs(table[:, 0] - table[:, 1]) > 1.0]
    np.testing.assert_allclose(apart[:, 2:], [modes_at(*row[:2]) for row in apart], rtol=1e-5)
    assert (np.diff(table[:, 2:], axis=1) < 0.0).any()
    # the first mass hardly feels the second spring
    effects = {(e.parameter, e.mode): e.contribution for e in found.record.effects}
    assert effects["k1", 1] > 0.9
    assert effects["k2", 1] < 0.1
    again = ft.screen(study)
    assert started(study) == 10
    assert again.record == found.record
    ft.screen(study, fresh=True)
    assert started(study) == 20


@pytest.mark.slow
@pytest.mark.parametrize(("design", "options"), [("morris", {"trajectories": 8}), ("sobol", {"runs": 8, "points": 64})])
def test_no_point_of_a_screening_is_run_twice(study: Path, design: str, options: dict[str, int]) -> None:
    """The trajectories of Morris meet on the grid of their levels."""
    found = ft.screen(study, design=design, **options)
    points = np.unique(found.runs[:, :2], axis=0)
    assert (len(points) < len(found.runs)) == (design == "morris")
    assert started(study) == 1 + len(points)
    assert ft.screen(study, design=design, **options).record == found.record
    assert started(study) == 1 + len(points)


def test_a_table_does_not_overwrite_files_of_the_solver(study: Path) -> None:
    script = study.parent / "solve.py"
    assert script.name in study.read_text()
    before = script.read_bytes()
    with pytest.raises(FemtuneError) as caught:
        ft.screen(study, csv=script)
    assert caught.value.code == "write.overwrites-input"
    assert script.read_bytes() == before


def test_a_table_does_not_overwrite_the_table_of_runs(table_study: Path) -> None:
    table = next(table_study.parent.glob("*.csv"))
    before = table.read_bytes()
    with pytest.raises(FemtuneError) as caught:
        ft.screen(table_study, csv=table)
    assert caught.value.code == "write.overwrites-input"
    assert table.read_bytes() == before


@pytest.mark.slow
def test_runs_of_a_screening_that_fail_are_named(study: Path) -> None:
    write_study(study.parent, FAKE_ABOVE="1400")
    found = ft.screen(study)
    points = found.arrays["screen_runs"][:, 0]
    assert [f.run for f in found.record.failed] == (np.flatnonzero(points > 1400.0) + 1).tolist()
    assert {f.reason.partition(":")[0] for f in found.record.failed} == {"exit code"}


@pytest.mark.slow
def test_a_search_on_the_solver_finds_the_truth_and_a_second_one_costs_nothing(study: Path) -> None:
    found = ft.search(study, runs=12)
    np.testing.assert_allclose([found.values["k1"], found.values["k2"]], TRUTH, rtol=1e-4)
    before = started(study)
    again = ft.search(study, runs=12)
    assert started(study) == before
    assert again.record.chi2 == found.record.chi2
    # the points of the search are those that an update of the same study may use
    ft.run(study)
    assert started(study) > before


@pytest.mark.parametrize("step", HOLDING)
def test_no_step_starts_the_solver_in_a_run_folder_that_is_in_use(study: Path, step: str) -> None:
    (study.parent / "run").mkdir()
    with locked(study.parent / "run"):
        if step == "check":
            assert [problem.code for problem in ft.check(study).problems] == ["run.locked"]
        else:
            with pytest.raises(FemtuneError) as caught:
                getattr(ft, step)(*[study] * (2 if step == "compare" else 1))
            assert caught.value.code == "run.locked"
    assert started(study) == 0


def test_every_step_on_a_study_is_known_to_hold_its_folder() -> None:
    # intervals refuses the model of a solver before anything is run
    starting_none = {"init", "view", "identify", "report", "intervals"}
    assert {step.name for step in all_steps() if step.command is not None} - starting_none == set(HOLDING)


def test_intervals_of_a_solver_are_refused(study: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.intervals(study)
    assert caught.value.code == "external.study"
    assert started(study) == 0


@pytest.mark.slow
def test_models_that_share_a_run_folder_are_read_one_after_the_other(study: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        ft.compare(study, study)
    # the masses have no coordinates, which is found once both are read
    assert caught.value.code == "correlate.no-common-points"
    assert not (study.parent / "run" / LOCK_FILE).exists()


@pytest.mark.slow
def test_two_steps_at_once_do_not_use_the_same_folder(study: Path) -> None:
    """The second one starts while the solver of the first one is at work."""
    write_study(study.parent, FAKE_S="0.3")
    first = threading.Thread(target=ft.modes, args=(study,))
    first.start()
    while not started(study) and first.is_alive():
        time.sleep(0.01)
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    first.join()
    assert caught.value.code == "run.locked"
    runs = started(study)
    assert ft.info(study).record is not None
    assert started(study) == runs


@pytest.mark.slow
def test_a_search_where_some_runs_fail(study: Path) -> None:
    write_study(study.parent, FAKE_ABOVE="1300")
    found = ft.search(study, runs=16)
    assert found.record.failed
    # 16 and one more for each that failed of them, 5 fresh ones, 5 where the objective may be better, the minimum
    first = [f.run for f in found.record.failed if f.run <= 16]
    assert found.record.runs == 16 + len(first) + 5 + 5 + 1
    np.testing.assert_allclose([found.values["k1"], found.values["k2"]], TRUTH, rtol=1e-4)


@pytest.mark.slow
def test_a_search_on_the_model_without_surrogate(study: Path) -> None:
    found = ft.search(study, on="model", population=8, generations=5, seeds=1)
    np.testing.assert_allclose([found.values["k1"], found.values["k2"]], TRUTH, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("step", ["screen", "search", "candidates"])
def test_steps_on_a_table_of_runs(table_study: Path, step: str) -> None:
    options = {"candidates": {"subsets": "all"}} if step == "candidates" else {}
    found = getattr(ft, step)(table_study, **options)
    if step == "search":
        np.testing.assert_allclose([found.values["k1"], found.values["k2"]], [9e3, 2.4e4], rtol=1e-3)
    if step == "candidates":
        assert [c.name for c in found.record.candidates if c.admissible] == ["S1.2"]
    if step == "screen":
        assert len(found.record.modes) == 4


@pytest.mark.long
def test_candidates_on_the_solver_with_starts_and_ties(study: Path) -> None:
    listed = '\n[candidates]\nstarts = 2\n\n[[candidate]]\nname = "both"\nparameters = ["k1", "k2"]\n'
    tied = '\n[[candidate]]\nname = "one"\nparameters = ["k1"]\nties = { k2 = "k1*0.9" }\n'
    study.write_text(study.read_text() + listed + tied)
    found = {c.name: c for c in ft.candidates(study).record.candidates}
    both = {value.parameter: value.value for value in found["both"].values}
    np.testing.assert_allclose([both["k1"], both["k2"]], TRUTH, rtol=1e-4)
    assert [c.name for c in found.values() if c.admissible] == ["both"]
    tied_values = {value.parameter: value.value for value in found["one"].values}
    assert tied_values["k2"] == pytest.approx(0.9 * tied_values["k1"])
    before = started(study)
    (study.parent / "run" / "candidates.jsonl").unlink()
    again = {c.name: c for c in ft.candidates(study).record.candidates}
    assert again["both"].chi2 == found["both"].chi2
    assert started(study) == before
