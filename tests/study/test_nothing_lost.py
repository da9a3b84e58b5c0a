"""What was computed is on disk, whatever happens afterwards; progress says what goes on."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.run_folder import read_results, unwritable

from .cantilever import Bench


class Told:
    """Keeps what it is told, and may raise at a step."""

    def __init__(self, stop: Callable[[str, int], bool] = lambda text, done: False) -> None:
        self.lines: list[tuple[str, int, int | None]] = []
        self.stop = stop

    def step(self, text: str, done: int, total: int | None) -> None:
        self.lines.append((text, done, total))
        if self.stop(text, done):
            raise KeyboardInterrupt


def history(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "history.jsonl").read_text().splitlines()]


@pytest.mark.quick(1)
@pytest.mark.parametrize("last", [0, 2])
def test_interrupted_update_leaves_its_history(beam: Bench, last: int) -> None:
    with pytest.raises(KeyboardInterrupt):
        ft.run(beam.study(), progress=Told(lambda text, done: text.startswith("update") and done == last))
    lines = history(beam.folder / "run")
    assert [line["iteration"] for line in lines] == list(range(last + 1))
    assert set(lines[-1]["parameters"]) == {"root", "tip"}


@pytest.mark.slow
def test_a_run_that_is_interrupted_keeps_the_results_of_an_earlier_one(beam: Bench) -> None:
    study = beam.study()
    first = ft.update(study)
    deck = (first.folder / "updated.bdf").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        ft.update(study, progress=Told(lambda text, done: text.startswith("update") and done == 1))
    assert read_results(first.folder)[0] == first.results
    assert (first.folder / "updated.bdf").read_bytes() == deck


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["gate", "deck", "parameter"])
def test_a_run_that_fails_early_keeps_everything_of_an_earlier_one(beam: Bench, fault: str) -> None:
    study = beam.study()
    first = ft.update(study)
    kept = {p: p.read_bytes() for p in first.folder.iterdir() if p.is_file()}
    if fault == "gate":
        study.write_text(study.read_text() + "[correlate]\nmac_gate = 1.0\nfrequency_gate = 1e-9\n")
    elif fault == "deck":
        beam.write("beam.bdf", beam.text[:400])
    else:
        study.write_text(study.read_text().replace("PBAR 1 I1", "PBAR 9 I1"))
    with pytest.raises(FemtuneError):
        ft.run(study)
    assert {p: p.read_bytes() for p in first.folder.iterdir() if p.is_file()} == kept


@pytest.mark.slow
@pytest.mark.parametrize("fault", [OSError(28, "No space left on device"), KeyboardInterrupt(), MemoryError()])
def test_results_are_kept_when_the_write_back_fails(
    beam: Bench, monkeypatch: pytest.MonkeyPatch, fault: BaseException
) -> None:
    def fail(*_: object) -> None:
        raise fault

    monkeypatch.setattr("femtune.steps.write.in_run.write_back", fail)
    with pytest.raises(type(fault)):
        ft.update(beam.study())
    results, _ = read_results(beam.folder / "run")
    assert results.update is not None
    assert {p.name: p.value for p in results.update.parameters} == pytest.approx({"root": 1.3, "tip": 0.85}, rel=1e-4)
    assert {c.stage for c in results.correlations} == {"before", "after"}
    assert (results.alerts[0].level, results.alerts[0].code) == ("problem", "run.unfinished")
    assert results.write_back is None
    if isinstance(fault, OSError):
        assert ft.report(beam.folder / "run").is_file()


@pytest.mark.slow
def test_an_error_of_the_write_back_says_where_the_results_are(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    # what can be foreseen is reported before the update; what happens while the deck is written cannot
    def full(*_: object) -> None:
        raise unwritable(beam.folder / "run", OSError(errno.ENOSPC, "no space left on device"))

    monkeypatch.setattr("femtune.steps.write.run.write_deck", full)
    with pytest.raises(FemtuneError) as caught:
        ft.update(beam.study())
    assert caught.value.values["results so far"] == str(beam.folder / "run/results.json")
    assert read_results(beam.folder / "run")[0].update is not None


@pytest.mark.slow
def test_inputs_that_vanish_during_the_run_do_not_spoil_it(beam: Bench) -> None:
    def remove(text: str, done: int) -> bool:
        if text.startswith("update") and done == 1:
            (beam.folder / "beam.uff").unlink()
        return False

    found = ft.update(beam.study(), progress=Told(remove)).results
    assert [f.path for f in found.provenance.input_files] == ["beam.bdf", "beam.uff"]


@pytest.mark.slow
def test_progress_names_the_steps_in_their_order(beam: Bench) -> None:
    told = Told()
    ft.run(beam.study(), progress=told)
    heads = [text.split(":")[0] for text, _, _ in told.lines]
    assert list(dict.fromkeys(heads)) == [
        "reading the deck", "configuration baseline", "mass and rigid-body check", "solving and pairing the modes",
        "modes and correlation, before", "sensitivities", "measures of the parameters", "mass and mesh", "update",
        "modes and correlation, after", "live model", "writing the updated deck",
        "modes and correlation, after as written",
        "χ² along the principal axes of the covariance", "fields that are no parameters",
        "writing the report", "drawing the pictures of the page",
    ]  # fmt: skip
    iterations = [done for text, done, _ in told.lines if text.startswith("update: weighted mean error")]
    assert iterations == list(range(len(iterations)))
    assert len(iterations) == len(history(beam.folder / "run"))
    assert all(total is None or 0 <= done <= total for _, done, total in told.lines)


@pytest.mark.quick(2)
@pytest.mark.parametrize("step", ["info", "modes", "correlate", "select"])
def test_every_step_says_something(beam: Bench, step: str) -> None:
    told = Told()
    getattr(ft, step)(beam.study(), progress=told)
    assert len(told.lines) >= 3
