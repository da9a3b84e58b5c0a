"""A whole study: known true values are found, and everything that a run leaves is right."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.results import Results, json_schema
from femtune.steps.run.result import RunResult
from femtune.steps.run_folder import read_results

from .cantilever import Bench


@pytest.fixture(scope="module")
def done(finished: tuple[Bench, RunResult]) -> RunResult:
    """A run that several tests look at."""
    return finished[1]


@pytest.fixture(scope="module")
def own(finished: tuple[Bench, RunResult]) -> Bench:
    """The bench of that run."""
    return finished[0]


def value(run: RunResult, name: str) -> float:
    assert run.results.update is not None
    return next(p.value for p in run.results.update.parameters if p.name == name)


def frequencies(run: RunResult, stage: str, configuration: int = 0) -> tuple[float, ...]:
    return [m.freq_hz for m in run.results.modes if m.stage == stage][configuration]


def test_true_values_are_found(done: RunResult) -> None:
    # shapes and frequencies of the file have six digits
    assert value(done, "root") == pytest.approx(1.3, rel=2e-5)
    assert value(done, "tip") == pytest.approx(0.85, rel=2e-5)
    assert done.results.update is not None
    assert done.results.update.ok


def test_the_folder_holds_all_files(done: RunResult) -> None:
    names = {"results.json", "arrays.npz", "history.jsonl", "updated.bdf", "report.html", "owner.json", "journal"}
    names |= {"report.html.sha256"}
    assert {p.name for p in done.folder.iterdir()} == names


def test_results_are_read_again(done: RunResult) -> None:
    results, arrays = read_results(done.folder)
    assert results == done.results
    assert results == Results.model_validate_json((done.folder / "results.json").read_text())
    assert set(arrays) == set(done.arrays)
    for key in results.array_keys():
        np.testing.assert_array_equal(arrays[key], done.arrays[key])


@pytest.mark.slow
def test_results_obey_the_published_schema(done: RunResult) -> None:
    jsonschema.validate(json.loads((done.folder / "results.json").read_text()), json_schema())


def test_history_is_the_way_of_the_update(done: RunResult) -> None:
    lines = [json.loads(line) for line in (done.folder / "history.jsonl").read_text().splitlines()]
    update = done.results.update
    assert update is not None
    assert [line["iteration"] for line in lines] == [i.iteration for i in update.history]
    assert [100 * line["mean_error"] for line in lines] == pytest.approx([i.objective_percent for i in update.history])
    assert lines[-1]["parameters"] == {"root": value(done, "root"), "tip": value(done, "tip")}


def test_provenance_names_the_word_that_was_run(done: RunResult) -> None:
    assert done.results.provenance.command.startswith("femtune.run(")


def test_before_is_the_users_deck(done: RunResult, own: Bench) -> None:
    assert frequencies(done, "before") == pytest.approx(own.modes(own.folder / "beam.bdf"), rel=1e-9)


def test_after_as_written_is_the_written_deck(done: RunResult, own: Bench) -> None:
    """Read, built and solved past the study."""
    assert frequencies(done, "after as written") == pytest.approx(own.modes(done.folder / "updated.bdf"), rel=1e-9)


def test_only_the_updated_fields_differ(done: RunResult, own: Bench) -> None:
    old, new = (p.read_bytes().splitlines() for p in (own.folder / "beam.bdf", done.folder / "updated.bdf"))
    changed = [i for i, (a, b) in enumerate(zip(old, new, strict=True)) if a != b]
    assert [old[i][:16].split() for i in changed] == [[b"PBAR", b"1"], [b"PBAR", b"2"]]
    for i in changed:
        assert old[i][:32] + old[i][40:] == new[i][:32] + new[i][40:]


def test_edits_name_old_and_new_text(done: RunResult) -> None:
    assert done.results.write_back is not None
    edit = done.results.write_back.edits[0]
    assert (edit.card, edit.field, edit.file, edit.old_text, edit.parameter) == (
        "PBAR 1",
        "I1",
        "beam.bdf",
        "2.0-7",
        "root",
    )
    assert edit.rounded_value == pytest.approx(2.6e-7, rel=1e-4)
    assert edit.value == pytest.approx(2e-7 * value(done, "root"), rel=1e-12)


@pytest.mark.slow
def test_small_field_rounds_and_wide_does_not(beam: Bench) -> None:
    study = beam.study(beam.parameters.replace('"PBAR 2 I1"', '"MAT1 1 E"'))
    small, wide = (
        ft.update(study, output=beam.folder / "small"),
        ft.update(study, output=beam.folder / "wide", wide=True),
    )
    for run, digits in ((small, 1e-3), (wide, 1e-9)):
        assert run.results.update is not None
        for p in run.results.update.parameters:
            nominal = {"root": 2e-7, "tip": 2.1e11}[p.name]
            assert p.written[0].value == pytest.approx(nominal * p.value, rel=digits)
    assert "PBAR*" in (wide.folder / "updated.bdf").read_text()
    assert "PBAR*" not in (small.folder / "updated.bdf").read_text()
    assert frequencies(wide, "after as written") == pytest.approx(frequencies(wide, "after"), rel=1e-8)
    for run in (small, wide):
        written = beam.modes(run.folder / "updated.bdf")
        assert frequencies(run, "after as written") == pytest.approx(written, rel=1e-9)


@pytest.mark.slow
def test_updated_deck_is_a_deck_for_the_next_study(beam: Bench) -> None:
    ft.update(beam.study())
    again = ft.update(beam.study(deck="run/updated.bdf"), output=beam.folder / "second")
    assert value(again, "root") == pytest.approx(1.0, abs=1e-4)
    assert again.results.update is not None
    assert again.results.update.objective_before_percent < 0.01


@pytest.mark.slow
def test_single_steps_agree_with_the_run(done: RunResult, own: Bench) -> None:
    study = own.folder / "study.toml"
    modes = ft.modes(study)[0]
    assert modes.model_copy(update={"mesh": None}) == done.results.modes[0]
    assert modes.mesh in done.results.model_checks
    assert ft.correlate(study)[0] == done.results.correlations[0]
    assert ft.select(study).record == done.results.selection
    facts = ft.info(study).record
    mass = tuple(c for c in facts.checks if c.check == "weighed mass")
    assert done.results.model is not None
    own_notices = done.results.model.notices
    # a run shows the warnings on the study among its alerts
    assert facts.notices[len(facts.notices) - len(own_notices) :] == own_notices
    assert facts.model_copy(update={"checks": mass, "notices": own_notices}) == done.results.model


def test_info_and_modes_take_a_deck_alone(beam: Bench) -> None:
    deck = beam.folder / "beam.bdf"
    facts = ft.info(deck).record
    # length 1 m, 1e-3 m² of steel, and 2 kg at the tip
    assert facts.configurations[0].mass == pytest.approx(7.85 + 2.0)
    assert facts.configurations[0].centre_of_gravity[0] == pytest.approx((7.85 * 0.5 + 2.0) / 9.85)
    assert ft.modes(deck)[0].freq_hz[:6] == pytest.approx(beam.modes(deck), rel=1e-9)


@pytest.mark.parametrize("step", [ft.correlate, ft.select, ft.update, ft.run])
def test_other_steps_want_a_study(beam: Bench, step: Any) -> None:
    with pytest.raises(FemtuneError) as caught:
        step(beam.folder / "beam.bdf")
    assert caught.value.code == "study.deck-alone"


@pytest.mark.slow
def test_report_is_written_again_from_the_study_or_the_folder(done: RunResult, own: Bench) -> None:
    assert done.report is not None
    first = done.report.read_bytes()
    done.report.unlink()
    assert ft.report(own.folder / "study.toml").read_bytes() == first
    assert ft.report(done.folder) == done.report


def test_provenance_names_every_file_with_its_sum(done: RunResult) -> None:
    provenance = done.results.provenance
    assert [f.path for f in provenance.input_files] == ["beam.bdf", "beam.uff"]
    assert provenance.study_file.path == "study.toml"
    assert all(len(f.sha256) == 64 for f in provenance.input_files)
    assert {d.step for d in provenance.durations} >= {"read", "correlate", "select", "update", "write back"}


@pytest.mark.slow
def test_nothing_but_the_run_folder_is_touched(beam: Bench) -> None:
    study = beam.study()
    before = {p: p.read_bytes() for p in beam.folder.rglob("*") if p.is_file()}
    ft.run(study)
    after = {p: p.read_bytes() for p in beam.folder.rglob("*") if p.is_file() and "run" not in p.parts}
    assert {p: b for p, b in after.items() if Path(p).parent.name != "run"} == before
