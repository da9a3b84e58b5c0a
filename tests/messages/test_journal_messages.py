"""What is said about the journal and the lock of a run folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.files.study_file import StudyFile, read_study_file
from femtune.journal.entry import Entry
from femtune.journal.journal import open_journal
from femtune.journal.run_files import RESULTS_FILE
from femtune.steps.held_folder import held
from femtune.steps.run_lock import LOCK_FILE, locked

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
    check_shown("run.locked", str(caught.value).replace(str(tmp_path), "RUN"))


def test_a_lock_of_this_machine(tmp_path: Path) -> None:
    with locked(tmp_path), pytest.raises(FemtuneError) as caught, locked(tmp_path):
        pass
    assert caught.value.hint == "wait until it has ended, or choose another output folder"
    assert set(caught.value.values) == {"process", "host", "since"}


def test_damaged_entries(tmp_path: Path) -> None:
    check_shown("journal.damaged, damaged entries", _notices(tmp_path, 1.0, "01"))
    check_shown("journal.damaged, damaged entries 2", _notices(tmp_path, 1.0, "01", "02"))


def test_a_full_journal(tmp_path: Path) -> None:
    check_shown("journal.full", _notices(tmp_path, 1e-6))


def test_a_journal_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "journal").touch()
    check_shown("journal.unwritable", _notices(tmp_path))


def _study(folder: Path, name: str, title: str) -> StudyFile:
    path = folder / name
    path.write_text(f'[study]\ntitle = "{title}"\ndeck = "beam.bdf"\nunits = "m-kg-s"\n[output]\nfolder = "run"\n')
    return read_study_file(path)


def _refusal(folder: Path, file: StudyFile) -> str:
    with pytest.raises(FemtuneError) as caught, held(file, folder / "run", "update"):
        pass
    return str(caught.value).replace(str(folder), "FOLDER")


@pytest.fixture
def beams(tmp_path: Path) -> Path:
    (tmp_path / "beam.bdf").write_text("BEGIN BULK\nENDDATA\n")
    return tmp_path


def test_the_folder_of_another_study(beams: Path) -> None:
    first, second = _study(beams, "first.toml", "First beam"), _study(beams, "second.toml", "Second beam")
    with held(first, beams / "run", "update") as place:
        (place.path / RESULTS_FILE).touch()
    check_shown("run.other-study", _refusal(beams, second))


def test_a_file_of_another(beams: Path) -> None:
    (beams / "run").mkdir()
    (beams / "run" / RESULTS_FILE).write_text("mine")
    check_shown("run.other-file", _refusal(beams, _study(beams, "first.toml", "First beam")))
    assert (beams / "run" / RESULTS_FILE).read_text() == "mine"
