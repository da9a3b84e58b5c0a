"""The journal of a run folder: every solution of the full model, under a key of all that it depends on.

One file a solution, ``<kind>-<key>.npz``, that appears whole. Nothing is changed or removed while a run goes on, so
that a run that was interrupted finds what the earlier one had solved.
"""

from __future__ import annotations

import os
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Generic, TypeVar

from femtune.errors import Notice, Where
from femtune.journal.entry import DamagedEntryError, Entry, read_entry, write_entry
from femtune.journal.run_files import JOURNAL_FOLDER

SCHEMA = 1
"""Version of the entries; it rises when those of an earlier femtune must not be used any more."""

T = TypeVar("T")
_FILE_NAME = re.compile(r"[a-z]+-[^.]+\.npz|\.[a-z]+-[^.]+\..+")
"""Names of entries, and, with a leading dot, of files that were being written when a run was killed."""
_FLUSHED_S = 0.1
"""Time of a solution in s from which its entry is flushed to the disk; a quicker one is sooner solved again."""


@dataclass(frozen=True)
class Form(Generic[T]):
    """How one kind of solution is packed into an entry of the journal and unpacked again.

    `unpack` raises ValueError, KeyError or TypeError if the entry is not such a solution.
    """

    kind: str
    pack: Callable[[T], Entry]
    unpack: Callable[[Entry], T]


@dataclass
class Journal:
    """Solutions on disk; `writes` is False for steps that only look up. Make it with `open_journal`."""

    folder: Path
    most_bytes: int
    writes: bool = True
    solved: Counter[str] = field(default_factory=Counter)
    recalled: Counter[str] = field(default_factory=Counter)
    stopped: Notice | None = None
    _damaged: list[tuple[Path, str]] = field(default_factory=list)
    _kept: set[Path] = field(default_factory=set)
    _recalled: set[Path] = field(default_factory=set)
    _used: int = 0

    def path(self, kind: str, key: str) -> Path:
        """The file of a solution."""
        return self.folder / f"{kind}-{key}.npz"

    def obtain(self, form: Form[T], key: str, solve: Callable[[], T]) -> T:
        """The solution of a key: from the journal, or solved and kept."""
        known = self.recall(form.kind, key)
        if known is not None:
            try:
                solution = form.unpack(known)
            except (ValueError, KeyError, TypeError) as error:
                self._damaged.append((self.path(form.kind, key), str(error)))
            else:
                self._count_recalled(form.kind, self.path(form.kind, key))
                return solution
        begin = time.perf_counter()
        solution = solve()
        self.solved[form.kind] += 1
        if self.writes:
            self.keep(form.kind, key, form.pack(solution), time.perf_counter() - begin > _FLUSHED_S)
        return solution

    def _count_recalled(self, kind: str, path: Path) -> None:
        """Count each solution once; those that this run has solved itself are not counted as recalled."""
        self.recalled[kind] += path not in self._kept and path not in self._recalled
        self._recalled.add(path)

    def recall(self, kind: str, key: str) -> Entry | None:
        """The entry of a key; None if there is none that can be used."""
        path = self.path(kind, key)
        try:
            entry = read_entry(path, self.most_bytes)
            if entry is not None and (entry.facts.get("kind"), entry.facts.get("key")) != (kind, key):
                raise DamagedEntryError("it belongs to something else")
        except DamagedEntryError as error:
            self._damaged.append((path, str(error)))
            return None
        return entry

    def keep(self, kind: str, key: str, entry: Entry, flush: bool = True) -> None:
        """Write an entry; if that fails, the run continues without the journal, with a notice.

        Without `flush` a loss of power may damage it, which is noticed when it is recalled.
        """
        if self.stopped is not None:
            return
        if self._used + entry.n_bytes > self.most_bytes:
            self.stopped = _full(self.folder, self.most_bytes)
            return
        path = self.path(kind, key)
        try:
            write_entry(path, Entry(entry.arrays, {**entry.facts, "kind": kind, "key": key}), flush)
        except OSError as error:
            self.stopped = _unwritable(self.folder, error)
            return
        self._used += entry.n_bytes
        self._kept.add(path)

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What the user should know: damaged entries, and why nothing more is kept."""
        damaged = (_damage(self._damaged),) if self._damaged else ()
        return damaged if self.stopped is None else (*damaged, self.stopped)

    @property
    def reused(self) -> tuple[Notice, ...]:
        """Notice of the solutions that came from an earlier run; none if there were none."""
        return from_journal(self.recalled.total(), self.solved.total())


def from_journal(recalled: int, solved: int) -> tuple[Notice, ...]:
    """Notice of the part of a run that came from an earlier one; none if there was none."""
    told = f"{recalled} of {recalled + solved} solutions from the journal of an earlier run"
    return (Notice("", told, level="info"),) if recalled else ()


def open_journal(run_folder: Path, most_gib: float, *, writes: bool = True, fresh: bool = False) -> Journal:
    """The journal of a run folder; `fresh` removes what is in it.

    If the folder cannot be made or cleared, the journal has a notice, and the run continues without it.
    """
    journal = Journal(run_folder / JOURNAL_FOLDER, int(most_gib * 2**30), writes)
    if writes:
        try:
            _prepare(journal, fresh)
        except OSError as error:
            journal.stopped = _unwritable(journal.folder, error)
    return journal


def _prepare(journal: Journal, fresh: bool) -> None:
    """Make the folder, remove incomplete files of an interrupted run, and sum up the sizes of the others."""
    if os.path.islink(journal.folder):
        raise OSError("it is a link to another place")
    journal.folder.mkdir(parents=True, exist_ok=True)
    for file in _files(journal.folder):
        if file.name.startswith(".") or fresh:
            os.unlink(file.path)
        else:
            journal._used += file.stat(follow_symlinks=False).st_size


def _files(folder: Path) -> Iterator[os.DirEntry[str]]:
    """Files with names of the journal, incomplete ones included; links are listed but not followed."""
    with os.scandir(folder) as files:
        for file in files:
            if _FILE_NAME.fullmatch(file.name) and not file.is_dir(follow_symlinks=False):
                yield file


def _damage(damaged: list[tuple[Path, str]]) -> Notice:
    first = f"{damaged[0][0].name}: {damaged[0][1]}"
    code = "journal.damaged/several" if len(damaged) > 1 else "journal.damaged"
    return Notice(code, where=Where(str(damaged[0][0].parent)), count=len(damaged), first=first)


def _unwritable(folder: Path, error: OSError) -> Notice:
    return Notice("journal.unwritable", where=Where(str(folder)), reason=error.strerror or error)


def _full(folder: Path, most_bytes: int) -> Notice:
    return Notice("journal.full", where=Where(str(folder)), size_gib=most_bytes / 2**30)
