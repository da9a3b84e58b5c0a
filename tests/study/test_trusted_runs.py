"""What a study of an external solver tells of its runs: rounded differences, changed files, a locked journal."""

from __future__ import annotations

import re
import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.files.study_file import read_study_file
from femtune.journal import runs as journal_runs
from femtune.study.external import solver_runs

from .two_masses import prepared, started


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return prepared(tmp_path)


def _with(study: Path, old: str, new: str) -> None:
    text = study.read_text()
    assert old in text
    study.write_text(text.replace(old, new, 1))


def _told(study: Path, code: str) -> list[str]:
    """What is told of the runs around the initial values, without the folder of the test."""
    runs = solver_runs(read_study_file(study))
    try:
        runs.around(np.array([800.0, 1000.0]))
        return [str(n).replace(str(study.parent), "FOLDER") for n in runs.remarks if n.code == code]
    finally:
        runs.journal.close()


def test_a_placeholder_that_rounds_a_difference_away_is_refused(study: Path) -> None:
    """800 ± 5 with one digit is 800."""
    (study.parent / "in.txt").write_text("{{k1:.0e}}\n{{k2}}\n")
    before = started(study)
    with pytest.raises(FemtuneError) as caught:
        ft.info(study)
    text = re.sub(r"8\d\d\.?\d* of", "805 of", str(caught.value).replace(str(study.parent), "FOLDER"))
    check_shown("external.placeholder, rounded-away", text)
    # the run at the initial values, and its repetition
    assert started(study) - before == 2


def test_a_placeholder_that_rounds_a_difference_is_told(study: Path) -> None:
    """800 ± 5.77 with three digits is 800 ± 6."""
    (study.parent / "in.txt").write_text("{{k1:.2e}}\n{{k2:.9e}}\n")
    (said,) = _told(study, "external.rounding")
    check_shown("external.rounding", re.sub(r"by [\d.]+ %", "by 4 %", said))


def test_twelve_digits_are_enough(study: Path) -> None:
    assert _told(study, "external.rounding") == []


def test_folders_that_the_command_names_are_told(study: Path) -> None:
    (study.parent / "library").mkdir()
    _with(study, '"solve.py"]', f'"solve.py", "{study.parent}/library"]')
    (said,) = _told(study, "external.not-watched")
    check_shown("external.not-watched", said)


def test_a_file_that_changes_while_the_solver_runs_is_told(study: Path) -> None:
    (study.parent / "count").write_text("")
    script = study.parent / "solve.py"
    count = str(study.parent / "count")
    script.write_text(f"name = {count!r}\nopen(name, 'a').write('x')\n" + script.read_text())
    (said,) = _told(study, "external.changed")
    check_shown("external.changed, file", said)


@pytest.mark.slow
@pytest.mark.parametrize("held", [False, True])
def test_a_journal_that_another_program_holds_is_waited_for(
    study: Path, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is neither called damaged nor moved away, and no solver is started without it."""
    ft.modes(study)
    before = started(study)
    monkeypatch.setattr(journal_runs, "QUIET_WAIT_S", 0.05)
    monkeypatch.setattr(journal_runs, "LONGEST_WAIT_S", 0.2 if held else 20.0)
    place = study.parent / "run" / "journal" / "runs.sqlite"
    with closing(sqlite3.connect(place, isolation_level=None, check_same_thread=False)) as other:
        other.execute("BEGIN EXCLUSIVE")
        if held:
            with pytest.raises(FemtuneError) as caught:
                ft.modes(study)
            text = str(caught.value).replace(str(study.parent), "FOLDER").replace("within 0 s", "within 31 s")
            check_shown("journal.locked", text)
        else:
            timer = threading.Timer(0.3, other.execute, ("ROLLBACK",))
            timer.start()
            ft.modes(study)
            timer.join()
    assert started(study) == before
    assert [p.name for p in place.parent.glob("runs.*")] == ["runs.sqlite"]


@pytest.mark.slow
def test_outcomes_wait_while_another_program_holds_the_journal(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ft.modes(study)
    first = runs_of(study)
    monkeypatch.setattr(journal_runs, "QUIET_WAIT_S", 0.05)
    place = study.parent / "run"
    journal = journal_runs.open_run_journal(place)
    outcome = journal.recall(first[0])
    assert outcome is not None
    other = sqlite3.connect(place / "journal" / "runs.sqlite", isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    journal.keep(journal_runs.RunOutcome("new", outcome.modes))
    assert journal.recall("new") is not None
    assert journal.notices == ()
    other.execute("ROLLBACK")
    other.close()
    journal.close()
    assert "new" in runs_of(study)


def runs_of(study: Path) -> list[str]:
    with closing(sqlite3.connect(study.parent / "run" / "journal" / "runs.sqlite")) as database:
        return [key for (key,) in database.execute("SELECT key FROM runs")]
