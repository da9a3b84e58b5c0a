"""Runs that have ended are on the disk, whatever ends the program, and nothing else is believed."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.journal.finished import FinishedRuns

LINES = [{"run": 0, "x": [1.0, 2.5]}, {"run": 1, "x": [0.1, 0.2]}, {"run": 2, "x": [3.0, 4.0]}]


@pytest.fixture
def content(tmp_path: Path) -> bytes:
    file = FinishedRuns(tmp_path / "whole.jsonl", "key")
    assert file.begin(True) == []
    for line in LINES:
        file.add(line)
    return file.path.read_bytes()


def test_cut_at_every_byte(tmp_path: Path, content: bytes) -> None:
    """A file that was cut anywhere has the runs before the cut; what is added later is found, too."""
    ends = [i + 1 for i, b in enumerate(content) if b == ord("\n")]
    for cut in range(len(content) + 1):
        file = FinishedRuns(tmp_path / "cut.jsonl", "key")
        file.path.write_bytes(content[:cut])
        known = sum(end <= cut for end in ends[1:])
        assert file.begin(True) == LINES[:known]
        file.add(LINES[-1])
        assert file.begin(True) == [*LINES[:known], LINES[-1]]


def test_finished_runs_are_not_written_again(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "whole.jsonl"
    before = path.stat()
    assert FinishedRuns(path, "key").begin(True) == LINES
    assert (path.stat().st_ino, path.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


@pytest.mark.parametrize("damage", [b"\x00" * 40, b"[1, 2]\n", b'{"run": NaN}', b"\xff\xfe\n", b"{" * 100_000 + b"\n"])
def test_damage_ends_what_is_believed(tmp_path: Path, content: bytes, damage: bytes) -> None:
    path = tmp_path / "whole.jsonl"
    path.write_bytes(content + damage + content)
    assert FinishedRuns(path, "key").begin(True) == LINES


def test_another_key_and_afresh(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "whole.jsonl"
    assert FinishedRuns(path, "other").begin(True) == []
    path.write_bytes(content)
    assert FinishedRuns(path, "key").begin(False) == []
    assert FinishedRuns(path, "key").begin(True) == []


def test_a_link_is_not_followed(tmp_path: Path, content: bytes) -> None:
    link, other = tmp_path / "link.jsonl", tmp_path / "whole.jsonl"
    link.symlink_to(other)
    assert FinishedRuns(link, "key").begin(True) == []
    assert other.read_bytes() == content
