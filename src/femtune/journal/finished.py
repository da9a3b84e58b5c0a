"""Finished runs in a file: a line of JSON for each, after a line that identifies the study and its inputs.

A line is on the disk before the next run is told of. Whatever ends the program, a power cut too, at most the line that
was being written is lost; what was kept before it is never written again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from femtune.files.whole_file import write_whole

Line = Mapping[str, Any]

_MOST_BYTES = 1 << 30
"""Bytes of the file, which is read at once: 1 GiB. Larger ones are not read."""


@dataclass(frozen=True)
class FinishedRuns:
    """The file of the runs of one kind in a run folder.

    Parameters
    ----------
    path : the file
    key : digest of all that the runs depend on; lines of another key are not used
    """

    path: Path
    key: str

    def begin(self, resume: bool) -> list[Line]:
        """The lines of an earlier run with the same key, if `resume`; otherwise the file is begun anew (errors
        OSError)."""
        lines, whole = self._read() if resume else ([], False)
        if not whole:
            text = "".join(_text(line) for line in ({"key": self.key}, *lines))
            write_whole(self.path, text.encode())
        return lines

    def add(self, line: Line) -> None:
        """A line for a run that has ended (errors OSError)."""
        with self.path.open("ab") as stream:
            stream.write(_text(line).encode())
            stream.flush()
            os.fsync(stream.fileno())

    def _read(self) -> tuple[list[Line], bool]:
        """Complete lines of a file with the same key, and whether the file contains nothing else."""
        try:
            if self.path.is_symlink() or self.path.stat().st_size > _MOST_BYTES:
                return [], False
            content = self.path.read_bytes()
        except OSError:
            return [], False
        entries = list(_lines(content))
        if not entries or entries[0] != {"key": self.key}:
            return [], False
        return entries[1:], content == b"".join(_text(line).encode() for line in entries)


def is_of_runs(path: Path) -> bool:
    """Whether a file is one of finished runs, of any study."""
    try:
        with path.open("rb") as stream:
            first = next(_lines(stream.readline(_MOST_BYTES)), {})
    except OSError:
        return False
    return set(first) == {"key"}


def _lines(content: bytes) -> Iterator[Line]:
    """Lines up to the first incomplete or damaged one."""
    for text in content.split(b"\n")[:-1]:
        try:
            line = json.loads(text)
        except (ValueError, RecursionError):
            return
        if not isinstance(line, dict):
            return
        yield line


def _text(line: Line) -> str:
    return json.dumps(dict(line), ensure_ascii=True, allow_nan=False) + "\n"
