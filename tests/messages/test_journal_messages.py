"""What is said about the journal and the lock of a run folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.study.journal import open_journal
from femtune.study.journal_entry import Entry
from femtune.study.run_lock import LOCK_FILE, locked

ENTRY = Entry({"shapes": np.zeros(1000)}, {})


def _notices(folder: Path, gib: float = 1.0, *damaged: str) -> str:
    journal = open_journal(folder, gib)
    for key in damaged:
        journal.path("modes", key).write_text("no archive")
        assert journal.recall("modes", key) is None
    journal.keep("modes", "ab", ENTRY)
    return "\n".join(map(str, journal.notices)).replace(str(folder), "RUN")


def test_a_lock_of_another_machine(tmp_path: Path) -> None:
    signed = {"pid": "4711", "host": "node12", "since": "2026-03-02T08:15:00+00:00"}
    (tmp_path / LOCK_FILE).write_text(json.dumps(signed))
    with pytest.raises(FemtuneError) as caught, locked(tmp_path):
        pass
    assert str(caught.value).replace(str(tmp_path), "RUN") == (
        "[run.locked] another run is at work in this run folder\n"
        "  at RUN/running.lock\n"
        "  process = 4711\n"
        "  host = node12\n"
        "  since = 2026-03-02T08:15:00+00:00\n\n"
        "hint: wait for it to end, or choose another folder with --output; "
        "if that run on node12 has ended, remove running.lock"
    )


def test_a_lock_of_this_machine(tmp_path: Path) -> None:
    with locked(tmp_path), pytest.raises(FemtuneError) as caught, locked(tmp_path):
        pass
    assert caught.value.hint == "wait for it to end, or choose another folder with --output"
    assert set(caught.value.values) == {"process", "host", "since"}


def test_damaged_entries(tmp_path: Path) -> None:
    assert _notices(tmp_path, 1.0, "01") == (
        "[journal.damaged] an entry of the journal was damaged and has been solved again; "
        "modes-01.npz: File is not a zip file at RUN/journal"
    )
    assert _notices(tmp_path, 1.0, "01", "02") == (
        "[journal.damaged] 2 entries of the journal were damaged and have been solved again; "
        "the first, modes-01.npz: File is not a zip file at RUN/journal"
    )


def test_a_full_journal(tmp_path: Path) -> None:
    assert _notices(tmp_path, 1e-6) == (
        "[journal.full] the journal has reached its 9.99e-07 GiB; what was solved afterwards is not kept. "
        "--fresh empties it, journal_gib in [study] lets it grow at RUN/journal"
    )


def test_a_journal_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "journal").touch()
    assert _notices(tmp_path) == (
        "[journal.unwritable] the journal cannot be written (File exists); the run went on without it at RUN/journal"
    )
