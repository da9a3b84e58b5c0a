"""What was solved is not solved again, and what is another model is."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import femtune as ft
from femtune.journal import entry as journal_entry
from femtune.journal import journal
from femtune.residuals import direct
from femtune.steps.run.result import RunResult
from femtune.steps.run_folder import read_results

from .cantilever import Bench


class Solved:
    """Counts what the model's own functions are asked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.points: list[tuple[float, ...]] = []
        self.derivatives = 0
        modes, derivative = direct.modes, direct.derivative

        def count_modes(point: Any, *limits: Any) -> Any:
            self.points.append(tuple(point.x))
            return modes(point, *limits)

        def count_derivatives(*given: Any) -> Any:
            self.derivatives += 1
            return derivative(*given)

        monkeypatch.setattr(type(direct), "modes", staticmethod(count_modes))
        monkeypatch.setattr(type(direct), "derivative", staticmethod(count_derivatives))

    @property
    def total(self) -> int:
        return len(self.points) + self.derivatives


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> Solved:
    return Solved(monkeypatch)


def counts(run: RunResult) -> tuple[int, int]:
    found = run.results.journal
    assert found is not None
    assert found.solved == sum(k.solved for k in found.kinds)
    assert found.recalled == sum(k.recalled for k in found.kinds)
    return found.solved, found.recalled


def codes(run: RunResult) -> list[str]:
    return [a.code for a in run.results.alerts if a.code.startswith("journal.")]


def same(first: RunResult, second: RunResult) -> None:
    """Equal to the last bit, but for time and counts."""
    apart = {"provenance", "journal", "alerts"}
    assert second.results.model_dump(exclude=apart) == first.results.model_dump(exclude=apart)
    assert set(first.arrays) == set(second.arrays)
    for key, array in first.arrays.items():
        np.testing.assert_array_equal(array, second.arrays[key])


def close(one: Any, other: Any) -> None:
    """Numbers of nested results but for rounding, everything else equal."""
    if isinstance(one, dict | list | tuple):
        assert len(one) == len(other)
        pairs = [(one[k], other[k]) for k in one] if isinstance(one, dict) else zip(one, other)
        for a, b in pairs:
            close(a, b)
    elif isinstance(one, float):
        assert one == pytest.approx(other, rel=1e-6, abs=1e-9)
    else:
        assert one == other


def replace_in(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_a_second_run_solves_nothing_and_finds_the_same(beam: Bench, solved: Solved) -> None:
    study = beam.study()
    first = ft.update(study)
    assert counts(first) == (solved.total, 0)
    assert solved.derivatives > 3
    total = solved.total
    second = ft.update(study)
    assert solved.total == total
    assert counts(second) == (0, total)
    same(first, second)
    assert not codes(second)
    assert read_results(second.folder)[0].journal == second.results.journal


@pytest.mark.slow
def test_a_journal_changes_no_result(beam: Bench) -> None:
    study = beam.study()
    first = ft.update(study)
    replace_in(study, "[modes]", "journal = false\n[modes]")
    second = ft.update(study, output=beam.folder / "other")
    assert second.results.journal is None
    assert not (second.folder / "journal").exists()
    same(first, second)


@pytest.mark.slow
def test_fresh_solves_all_again_and_empties_the_journal(beam: Bench, solved: Solved) -> None:
    study = beam.study()
    ft.update(study)
    total = solved.total
    old = beam.folder / "run/journal/modes-of-another-deck.npz"
    old.touch()
    own = beam.folder / "run/journal/notes.txt"
    own.touch()
    assert counts(ft.update(study, fresh=True)) == (total, 0)
    assert solved.total == 2 * total
    assert not old.exists()
    assert own.exists()


@pytest.mark.slow
def test_other_weights_share_the_points_of_the_way_that_are_the_same(beam: Bench, solved: Solved) -> None:
    study = beam.study()
    ft.update(study)
    solved.points.clear()
    replace_in(
        study, "[modes]", "[residuals]\nfrequency_sd = 0.02\nshape_sd = 0.05\n[correlate]\nmac_gate = 0.6\n[modes]"
    )
    assert counts(ft.update(study))[1] > 4
    assert (0.0, 0.0) not in solved.points


@pytest.mark.slow
def test_bounds_do_not_matter_to_solutions_and_the_start_does(beam: Bench, solved: Solved) -> None:
    study = beam.study()
    ft.update(study)
    solved.points.clear()
    replace_in(study, "upper = 2.0", "upper = 1.2")
    bounded = ft.update(study).results.update
    assert bounded is not None
    assert {p.name: p.value for p in bounded.parameters}["root"] <= 1.2
    assert (0.0, 0.0) not in solved.points
    solved.points.clear()
    replace_in(study, "upper = 1.2", "upper = 2.0\nnominal = 1.1")
    ft.update(study)
    assert (0.0, 0.0) in solved.points


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("beam.bdf", "7850.", "7851."),
        ("beam.bdf", "2.1+11", "2.2+11"),
        ("beam.bdf", "CONM2   9       5               2.0", "CONM2   9       5               2.01"),
        ("beam.bdf", "123456  1", "12346   1"),
        ("study.toml", "count = 6", "count = 7"),
        ("study.toml", "count = 6", "max_hz = 500.0"),
        ("study.toml", "[modes]", '[[configuration]]\nname = "A"\nmasses = [{node = 3, mass = 0.1}]\n[modes]'),
    ],
)
def test_another_model_is_solved(beam: Bench, solved: Solved, name: str, old: str, new: str) -> None:
    study = beam.study(test=None, tail="")
    tail = f'test = "beam.uff"\n{beam.parameters}'
    study.write_text(study.read_text() + f'[[configuration]]\nname = "B"\n{tail}')
    ft.update(study)
    solved.points.clear()
    replace_in(beam.folder / name, old, new)
    changed = ft.modes(study)
    assert len(solved.points) == 1
    assert ft.modes(study, fresh=True).records == changed.records


@pytest.mark.slow
def test_another_parameter_shares_the_modes_and_not_their_derivatives(beam: Bench, solved: Solved) -> None:
    study = beam.study()
    ft.select(study)
    before = ft.update(study)
    solved.points.clear()
    solved.derivatives = 0
    replace_in(study, "PBAR 2 I1", "PBAR 2 I2")
    found = ft.select(study).record
    assert not solved.points
    assert solved.derivatives > 0
    # another choice of parameters adds the same matrices up in another order: the last bits differ
    close(found.model_dump(), ft.select(study, fresh=True).record.model_dump())
    assert found != before.results.selection


@pytest.mark.slow
@pytest.mark.parametrize("step", ["modes", "correlate", "select"])
def test_other_steps_look_up_and_write_nothing(beam: Bench, solved: Solved, step: str) -> None:
    study = beam.study()
    function = getattr(ft, step)

    def records(**options: bool) -> Any:
        found = function(study, **options)
        return found.record if step == "select" else found.records

    alone = records()
    assert not (beam.folder / "run").exists()
    folder = ft.update(study).folder / "journal"
    kept, total = sorted(folder.iterdir()), solved.total
    remarks = [str(remark) for remark in function(study).remarks]
    assert records() == alone
    assert solved.total == total
    assert sorted(folder.iterdir()) == kept
    assert len(remarks) == 1
    number = int(remarks[0].split()[0])
    assert remarks[0] == f"{number} of {number} solutions from the journal of an earlier run"
    assert records(fresh=True) == alone
    assert solved.total == total + number


@pytest.mark.slow
def test_the_disk_is_full(beam: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    study, write = beam.study(), journal_entry.write_whole_by
    whole = ft.update(study, output=beam.folder / "whole")
    left = 5

    def full(*given: Any) -> None:
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(*given)

    monkeypatch.setattr(journal_entry, "write_whole_by", full)
    run = ft.update(study)
    assert codes(run) == ["journal.unwritable"]
    assert len(list((run.folder / "journal").iterdir())) == 5
    assert left == -1
    same(whole, run)


@pytest.mark.slow
def test_the_journal_stops_at_its_size(beam: Bench) -> None:
    study = beam.study()
    replace_in(study, "[modes]", "journal_gib = 2e-5\n[modes]")
    run = ft.update(study)
    assert codes(run) == ["journal.full"]
    size = sum(p.stat().st_size for p in (run.folder / "journal").iterdir())
    assert 0 < size <= 2e-5 * 2**30
    again = ft.update(study)
    assert codes(again) == ["journal.full"]
    assert 0 < counts(again)[1] < sum(counts(again))
    same(run, again)


@pytest.mark.slow
def test_a_journal_that_leads_elsewhere_is_not_written(beam: Bench) -> None:
    (beam.folder / "elsewhere").mkdir()
    (beam.folder / "run").mkdir()
    (beam.folder / "run/journal").symlink_to(beam.folder / "elsewhere", target_is_directory=True)
    assert codes(ft.update(beam.study())) == ["journal.unwritable"]
    assert not list((beam.folder / "elsewhere").iterdir())


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.slow
def test_what_is_half_written_is_swept_away(beam: Bench, fresh: bool) -> None:
    folder = beam.folder / "run/journal"
    folder.mkdir(parents=True)
    half = folder / ".modes-0123.npz.abcd"
    half.write_bytes(b"PK")
    (folder / "a-folder.npz").mkdir()
    assert not codes(ft.update(beam.study(), fresh=fresh))
    assert not half.exists()


@pytest.mark.slow
def test_a_damaged_entry_is_solved_again_and_replaced(beam: Bench, solved: Solved) -> None:
    study = beam.study()
    first = ft.update(study)
    total = solved.total
    entries = sorted((first.folder / "journal").glob("modes-*.npz"))
    contents = [p.read_bytes() for p in entries]
    entries[0].write_bytes(contents[0][:-40])
    entries[1].write_bytes(contents[2])
    entries[2].unlink()
    entries[2].symlink_to(entries[3])
    second = ft.update(study)
    assert solved.total == total + 3
    assert codes(second) == ["journal.damaged"]
    same(first, second)
    assert [p.read_bytes() for p in entries] == contents
    assert not entries[2].is_symlink()
    third = ft.update(study)
    assert counts(third) == (0, total)
    assert not codes(third)


@pytest.mark.slow
def test_wrong_arrays_in_a_sound_file_are_noticed(beam: Bench) -> None:
    study = beam.study()
    first = ft.update(study)
    for path in sorted((first.folder / "journal").iterdir()):
        entry = journal_entry.read_entry(path, 1 << 30)
        assert entry is not None
        cut = {name: array[..., :-1] if name == "shapes" else array for name, array in entry.arrays.items()}
        journal_entry.write_entry(path, journal_entry.Entry(cut, entry.facts))
    second = ft.update(study)
    assert counts(second)[1] == 0
    assert codes(second) == ["journal.damaged"]
    same(first, second)


@pytest.mark.slow
@pytest.mark.parametrize("schema", ["version", "schema"])
def test_another_version_finds_nothing(beam: Bench, monkeypatch: pytest.MonkeyPatch, schema: str) -> None:
    from femtune.journal import solver as journaled  # noqa: PLC0415

    study = beam.study()
    ft.update(study)
    name, value = ("__version__", "999") if schema == "version" else ("SCHEMA", journal.SCHEMA + 1)
    monkeypatch.setattr(journaled, name, value)
    assert counts(ft.update(study))[1] == 0
