"""`check_reader` finds what breaks its rules, and the readers of the house keep them."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp

import femtune as ft
from femtune.errors import FemtuneError, Notice, Where
from femtune.files.damping_catalogue import read_catalogue
from femtune.files.matrices.read import read_matrix
from femtune.files.records import read_record
from femtune.files.repeats_table import read_repeats_table
from femtune.files.study_file import read_study_file
from femtune.testing import check_reader, example_deck, example_test
from femtune.testing.readers import alike, damaged

Table = dict[str, float]


def _table(path: Path) -> Table:
    """A reader that keeps the rules: lines of a name and a number."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FemtuneError("uff.unreadable", f"{path.name} cannot be read", where=Where(str(path))) from error
    found = {}
    for number, line in enumerate(lines, 1):
        words = line.split()
        try:
            name, value = words
            found[name] = float(value)
        except ValueError as error:
            raise FemtuneError("uff.value", f"{path.name}: no number", where=Where(str(path), number)) from error
    return found


@pytest.fixture(autouse=True)
def _files_that_break_a_rule(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are kept in the folder of the test, instead of that of the system."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "table.txt"
    path.write_text("one 1.0\ntwo 2.0\nthree 3.0\n", encoding="utf-8")
    return path


def test_a_good_reader_passes_and_is_measured(file: Path) -> None:
    def complete(data: Table) -> None:
        assert data == {"one": 1.0, "two": 2.0, "three": 3.0}

    found = check_reader(_table, file, complete=complete, unknown="four\n", mutants=30)
    assert found.read > 0
    assert found.refused > 30
    assert 0.0 < found.slowest_s < 5.0


def _raising(path: Path) -> Table:
    return {line.split()[0]: float(line.split()[1]) for line in path.read_text(encoding="utf-8").splitlines()}


def _hanging(path: Path) -> Table:
    found = _table(path)
    if len(found) != 3:
        while True:
            try:
                time.sleep(0.01)
            # what a careless reader does
            except Exception:
                continue
    return found


def _warning(path: Path) -> Table:
    found = _table(path)
    if any(abs(v) > 1e30 for v in found.values()):
        warnings.warn("overflow encountered", RuntimeWarning, stacklevel=1)
    return found


def _greedy(path: Path) -> Any:
    return np.zeros(20_000_000) if len(_table(path)) == 2 else _table(path)


def _forgetful(path: Path) -> Table:
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else None
    if lines is None:
        raise FemtuneError("uff.unreadable", f"{path.name} cannot be read")
    return {words[0]: 1.0 for words in map(str.split, lines) if len(words) == 2}


def _nameless(path: Path) -> Table:
    if not path.is_file():
        raise FemtuneError("uff.unreadable", "cannot be read")
    return _table(path)


def _careless(path: Path) -> Table:
    return _table(path) if path.is_file() else {}


def _writing(path: Path) -> Table:
    found = _table(path)
    path.write_text(path.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    return found


_COUNT = iter(range(10_000))


def _changing(path: Path) -> Table:
    return {**_table(path), "call": float(next(_COUNT))}


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (_raising, "no FemtuneError"),
        (_hanging, "did not end within 0.4 s"),
        (_warning, "RuntimeWarning and no FemtuneError: overflow"),
        (_greedy, "MB, more than 50 MB"),
        (_nameless, "does not name it"),
        (_careless, "was read"),
        (_writing, "gives different data|reading has changed|no number"),
        (_changing, "read twice, gives different data"),
        (_forgetful, "dropped without a notice that has its line"),
    ],
)
@pytest.mark.quick(2)
def test_a_reader_that_breaks_a_rule_is_found(read: Callable[[Path], Any], words: str, file: Path) -> None:
    with pytest.raises((AssertionError, FemtuneError), match=words):
        check_reader(read, file, unknown="four\n", mutants=40, seconds=0.2, megabytes=50.0)


def test_the_file_that_broke_a_rule_is_kept(file: Path) -> None:
    def read(path: Path) -> Table:
        found = _table(path)
        if len(found) == 2:
            raise KeyError("three")
        return found

    with pytest.raises(AssertionError, match="KeyError") as failed:
        check_reader(read, file, mutants=40)
    kept = Path(str(failed.value).rsplit("kept in ", 1)[1])
    assert len(_table(kept)) == 2


def test_a_notice_with_its_line_is_enough(file: Path) -> None:
    def read(path: Path) -> tuple[Table, tuple[Notice, ...]]:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
        if not path.is_file():
            raise FemtuneError("uff.unreadable", f"{path.name} cannot be read")
        found = {words[0]: words[1] for words in map(str.split, lines) if len(words) == 2}
        left = [i for i, line in enumerate(lines, 1) if len(line.split()) != 2]
        return found, tuple(Notice("uff.ignored", "ignored", Where(str(path), i)) for i in left)

    assert check_reader(read, file, unknown="four\n", notices=lambda data: data[1], mutants=10).refused == 0


def test_mutants_are_the_same_for_the_same_seed(file: Path) -> None:
    good = file.read_bytes()
    first, again, other = (dict(damaged(good, 20, seed)) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert good not in [content for words, content in first.items() if "unchanged" not in words and "1 with 1" in words]


def test_data_are_compared_throughout() -> None:
    assert alike({"a": (np.array([1.0, np.nan]),)}, {"a": (np.array([1.0, np.nan]),)})
    assert not alike({"a": (np.array([1.0, np.nan]),)}, {"a": (np.array([1.0, 2.0]),)})
    assert not alike(np.zeros(2), np.zeros(2, int))
    assert alike(sp.eye_array(2), sp.eye_array(2))
    assert not alike([1.0], (1.0,))


def _written(folder: Path, kind: str) -> Path:
    """A small good file of a kind."""
    if kind == "uff":
        return example_test(folder)
    if kind == "deck":
        return example_deck(folder)
    if kind == "mtx":
        scipy.io.mmwrite(folder / "k.mtx", sp.diags_array([400.0, 900.0, 3.5]))
        return folder / "k.mtx"
    texts = {
        "toml": '[study]\ntitle = "t"\ndeck = "study.toml"\nunits = "m-kg-s"\n[modes]\ncount = 4\n[[parameter]]\n'
        'name = "E"\nfields = ["MAT1 1 E"]\nlower = 0.5\nupper = 2.0\n',
        "csv": "time,12Z+,13Z+\n" + "".join(f"{i / 64},{np.sin(i):.6f},{np.cos(i):.6f}\n" for i in range(40)),
        "repeats": "1,2\n10.0,60.0\n11.0,61.0\n10.5,60.5\n",
        "damping": '[[damping]]\nname = "rubber"\nof = "joint"\nfields = ["PBUSH 9 GE1"]\nvalue = 0.2\nsd = 0.02\n'
        'unit = ""\nsource = "test"\ndate = "2026-01-01"\nstudy = "t"\n',
    }
    names = {"toml": "study.toml", "csv": "record.csv", "repeats": "repeats.csv", "damping": "damping.toml"}
    path = folder / names[kind]
    path.write_text(texts[kind], encoding="utf-8")
    return path


_OURS: dict[str, tuple[Callable[[Path], Any], str | None]] = {
    "uff": (ft.read_test, "    -1\n  9999\n     1\n    -1"),
    "deck": (ft.read_deck, "CFOO,7,1,2"),
    "mtx": (read_matrix, None),
    "toml": (read_study_file, "colour = 3"),
    "csv": (read_record, "no,numbers,here"),
    "repeats": (read_repeats_table, "no,numbers"),
    # a catalogue is told by the number of the entry, not by its line
    "damping": (read_catalogue, None),
}


@pytest.mark.quick(1)
@pytest.mark.parametrize("kind", _OURS)
def test_the_readers_of_the_house_keep_the_rules(kind: str, tmp_path: Path) -> None:
    read, unknown = _OURS[kind]
    found = check_reader(read, _written(tmp_path, kind), unknown=unknown, mutants=25)
    assert found.refused > 25
