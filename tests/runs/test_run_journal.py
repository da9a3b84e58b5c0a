"""The journal of external runs: nothing is run twice, and nothing that is damaged is believed."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown
from tests.runs.fake import fail, fake_solver, started

from femtune.executor import Threads
from femtune.files.modes.solved import SolvedModes
from femtune.journal.runs import open_run_journal
from femtune.runs import evaluate
from femtune.runs.outcome import RunOutcome

POINTS = [{"k1": 4.0 + i, "k2": 9.0, "point": i} for i in range(6)]


@pytest.mark.slow
def test_a_second_run_costs_nothing(tmp_path: Path) -> None:
    solver = fake_solver(tmp_path)
    fail(tmp_path, 3, "crash", 9)
    journal = open_run_journal(tmp_path)
    first = evaluate(solver, POINTS, Threads(2), journal)
    journal.close()
    before = started(tmp_path)
    journal = open_run_journal(tmp_path)
    second = evaluate(solver, POINTS, Threads(2), journal)
    assert (second.started, started(tmp_path), journal.recalled.total()) == (0, before, 6)
    assert first.failed == second.failed == (3,)
    for one, other in zip(first.outcomes, second.outcomes):
        assert (one.key, one.failures) == (other.key, other.failures)
        if one.modes is not None and other.modes is not None:
            np.testing.assert_array_equal(one.modes.freq_hz, other.modes.freq_hz)
            np.testing.assert_array_equal(one.modes.shapes, other.modes.shapes)
            np.testing.assert_array_equal(one.modes.nodes, other.modes.nodes)
    assert journal.states() == {"done": 5, "exit code": 1}
    journal.close()
    assert evaluate(solver, POINTS[:1], Threads(1), open_run_journal(tmp_path, fresh=True)).started == 1


def test_an_outcome_that_is_not_lasting_is_not_kept(tmp_path: Path) -> None:
    journal, modes = open_run_journal(tmp_path), SolvedModes.of_frequencies(np.array([1.0, 2.0]))
    journal.keep(RunOutcome("a", modes, lasting=False))
    journal.keep(RunOutcome("b", modes))
    assert (journal.recall("a"), journal.recall("b") is not None) == (None, True)
    journal.close()


def test_a_file_that_is_no_journal_is_put_aside(tmp_path: Path) -> None:
    journal = open_run_journal(tmp_path)
    journal.close()
    journal.path.write_bytes(b"SQLite format 3\0" + b"\xff" * 5000)
    journal = open_run_journal(tmp_path)
    assert evaluate(fake_solver(tmp_path), POINTS[:1], Threads(1), journal).started == 1
    assert [n.code for n in journal.notices] == ["journal.damaged"]
    assert journal.path.with_suffix(".damaged").exists()
    assert journal.recall(fake_solver(tmp_path).key(POINTS[0])) is not None


@pytest.mark.parametrize("make", ["CREATE VIEW runs AS SELECT 1 AS key", "CREATE TABLE other (a)"])
def test_another_database_is_put_aside(tmp_path: Path, make: str) -> None:
    (tmp_path / "journal").mkdir()
    with sqlite3.connect(tmp_path / "journal" / "runs.sqlite") as other:
        other.execute(make)
    assert [n.code for n in open_run_journal(tmp_path).notices] == ["journal.damaged"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    ["facts = '{}'", "facts = 'no json'", "freq_hz = x'00'", "shapes = x'0000000000000000'", "nodes = 'text'"],
)
def test_a_damaged_row_is_run_again(tmp_path: Path, change: str) -> None:
    solver, journal = fake_solver(tmp_path), open_run_journal(tmp_path)
    evaluate(solver, POINTS[:2], Threads(1), journal)
    journal.close()
    with sqlite3.connect(journal.path) as database:
        database.execute(f"UPDATE runs SET {change}")
    journal = open_run_journal(tmp_path)
    assert evaluate(solver, POINTS[:2], Threads(1), journal).started == 2
    assert {n.code for n in journal.notices} == {"journal.damaged"}


@pytest.mark.slow
def test_a_full_disk_stops_the_journal_and_not_the_runs(tmp_path: Path) -> None:
    journal = open_run_journal(tmp_path)
    assert journal.database is not None
    pages = journal.database.execute("PRAGMA page_count").fetchone()[0]
    # SQLite reports this as it reports a disk that is full
    journal.database.execute(f"PRAGMA max_page_count = {pages}")
    points = [{"k1": 4.0 + i, "k2": 9.0, "point": i} for i in range(25)]
    found = evaluate(fake_solver(tmp_path), points, Threads(2), journal)
    assert (found.failed, found.started) == ((), 25)
    check_shown("journal.unwritable, external runs", str(journal.notices[0]).replace(str(tmp_path), "RUN"))


def test_participation_factors_are_kept(tmp_path: Path) -> None:
    """Also those that are not finite, as of rigid-body modes."""
    factors = np.array([[1.0, -2.5], [np.inf, np.nan], *np.zeros((4, 2))])
    modes = SolvedModes(np.array([1.0, 2.0]), np.array([7]), np.ones((1, 6, 2)), None, factors)
    journal = open_run_journal(tmp_path)
    journal.keep(RunOutcome("a", modes))
    journal.keep(RunOutcome("b", replace(modes, participation=None)))
    journal.close()
    journal = open_run_journal(tmp_path)
    found = [journal.recall(key) for key in "ab"]
    journal.close()
    first, second = (outcome.modes for outcome in found if outcome is not None)
    assert first is not None
    assert first.participation is not None
    np.testing.assert_array_equal(first.participation, factors)
    assert second is not None
    assert second.participation is None
