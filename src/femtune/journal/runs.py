"""The journal of external runs: every outcome by the digest of its inputs, in one SQLite file of the run folder.

An outcome is committed when its run has ended, so that a program that is killed loses the runs under way and no other.
As in the journal of solutions, nothing is ever unpickled, and a file that cannot be used is put aside with a notice.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from femtune.errors import FemtuneError, Notice, Where
from femtune.executor.interface import nothing
from femtune.files.modes.solved import SolvedModes
from femtune.journal.run_files import JOURNAL_FOLDER
from femtune.runs.outcome import Failure, FailureKind, RunOutcome

FILE = "runs.sqlite"
"""Database of the runs, in the folder of the journal."""
_KIND = "external run"
"""What the runs are called where solutions are counted."""
_SCHEMA = 1
"""Version of the database; a file of another version is not used."""
_TABLE = (
    "CREATE TABLE IF NOT EXISTS runs (key TEXT PRIMARY KEY, state TEXT NOT NULL, facts TEXT NOT NULL, "
    "freq_hz BLOB, nodes BLOB, shapes BLOB)"
)
"""Table of the runs: the outcome of each key, and the modes of a run that succeeded."""
QUIET_WAIT_S = 1.0
"""Time in s for which another program is waited for without a word."""
LONGEST_WAIT_S = 30.0
"""Time in s after which a program that still holds the journal is not one that soon ends."""
_REAL = np.dtype("<f8")
"""Type of frequencies and shapes in the database, the same on all machines."""
_INTEGER = np.dtype("<i8")
"""Type of node numbers in the database."""
# what SQLite, the standard library and numpy raise on databases that are damaged
_TROUBLES = (sqlite3.Error, ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError)


@dataclass
class RunJournal:
    """Outcomes on disk; make it with `open_run_journal`."""

    path: Path
    solved: Counter[str] = field(default_factory=Counter)
    recalled: Counter[str] = field(default_factory=Counter)
    stopped: Notice | None = None
    _remarks: list[Notice] = field(default_factory=list)
    _waiting: dict[str, RunOutcome] = field(default_factory=dict)
    database: sqlite3.Connection | None = None

    def recall(self, key: str) -> RunOutcome | None:
        """The outcome of a key; None if there is none that can be used."""
        if key in self._waiting:
            return self._waiting[key]
        if self.database is None:
            return None
        try:
            row = self.database.execute(
                "SELECT facts, freq_hz, nodes, shapes FROM runs WHERE key = ?", (key,)
            ).fetchone()
            outcome = None if row is None else _outcome(key, row)
        except _TROUBLES as error:
            if _is_locked(error):
                raise FemtuneError("journal.locked", where=Where(str(self.path)), seconds=LONGEST_WAIT_S) from error
            self._remarks.append(_damaged(self.path, error))
            return None
        self.recalled[_KIND] += outcome is not None
        return outcome

    def keep(self, outcome: RunOutcome) -> None:
        """Keep an outcome that may last; if that fails, the runs continue without the journal, with a notice.

        While another program holds the journal, outcomes wait in memory.
        """
        self.solved[_KIND] += 1
        if self.database is None or self.stopped is not None or not outcome.lasting:
            return
        self._waiting[outcome.key] = outcome
        self._write(QUIET_WAIT_S)

    def _write(self, wait_s: float) -> None:
        """Write what waits, unless another program holds the file for longer than `wait_s`."""
        if self.database is None or not self._waiting:
            return
        _wait(self.database, wait_s)
        try:
            with self.database:
                self.database.executemany(
                    "INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?, ?)", map(_row, self._waiting.values())
                )
            self._waiting.clear()
        except sqlite3.Error as error:
            if not _is_locked(error):
                self._waiting.clear()
                self.stopped = Notice("journal.unwritable", where=Where(str(self.path)), reason=error)
        finally:
            _wait(self.database, LONGEST_WAIT_S)

    def states(self) -> dict[str, int]:
        """Number of outcomes by their state, for tables."""
        if self.database is None:
            return {}
        counts = self.database.execute("SELECT state, COUNT(*) FROM runs GROUP BY state ORDER BY state")
        return {str(state): int(count) for state, count in counts}

    def close(self) -> None:
        """Write what waits, and close the file."""
        if self.database is not None:
            self._write(LONGEST_WAIT_S)
            if self._waiting:
                self.stopped = Notice("journal.unwritable", where=Where(str(self.path)), reason="it is locked")
            self.database.close()
            self.database = None

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What the user should know."""
        return (*self._remarks, *(() if self.stopped is None else (self.stopped,)))


def open_run_journal(run_folder: Path, *, fresh: bool = False, waiting: Callable[[], None] = nothing) -> RunJournal:
    """The journal of external runs in a run folder; `fresh` removes what is in it.

    A file that is not such a journal is put aside. If none can be made, there is a notice, and the runs continue
    without it.

    Parameters
    ----------
    waiting : is called where another program has locked the journal, and is waited for

    Raises
    ------
    FemtuneError : ``journal.locked``
    """
    journal = RunJournal(run_folder / JOURNAL_FOLDER / FILE)
    try:
        _prepare(journal.path, fresh)
        journal.database = _unlocked(journal.path, waiting)
    except OSError as error:
        journal.stopped = Notice("journal.unwritable", where=Where(str(journal.path)), reason=error.strerror or error)
    except (sqlite3.Error, ValueError) as error:
        journal._remarks.append(_damaged(journal.path, error))
        _begin_anew(journal)
    return journal


def _prepare(path: Path, fresh: bool) -> None:
    if os.path.islink(path.parent) or os.path.islink(path):
        raise OSError("it is a link to another place")
    path.parent.mkdir(parents=True, exist_ok=True)
    if fresh:
        _remove(path)


def _remove(path: Path) -> None:
    for name in (path, path.with_name(f"{FILE}-journal"), path.with_name(f"{FILE}-wal")):
        name.unlink(missing_ok=True)


def _begin_anew(journal: RunJournal) -> None:
    try:
        os.replace(journal.path, journal.path.with_suffix(".damaged"))
        _remove(journal.path)
        journal.database = _opened(journal.path)
    except (OSError, sqlite3.Error) as error:
        journal.stopped = Notice("journal.unwritable", where=Where(str(journal.path)), reason=error)


def _wait(database: sqlite3.Connection, wait_s: float) -> None:
    """How long another program that holds the database is waited for."""
    database.execute(f"PRAGMA busy_timeout = {int(1000.0 * wait_s)}")


def _is_locked(error: Exception) -> bool:
    """Whether another program holds the database: nothing is wrong with it."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    return code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)


def _unlocked(path: Path, waiting: Callable[[], None]) -> sqlite3.Connection:
    """The database, when another program has released it (errors as of `_opened`, ``journal.locked``)."""
    try:
        return _opened(path, QUIET_WAIT_S)
    except sqlite3.Error as error:
        if not _is_locked(error):
            raise
    waiting()
    try:
        return _opened(path, LONGEST_WAIT_S)
    except sqlite3.Error as error:
        if not _is_locked(error):
            raise
        waited = QUIET_WAIT_S + LONGEST_WAIT_S
        raise FemtuneError("journal.locked", where=Where(str(path)), seconds=waited) from error


def _opened(path: Path, wait_s: float = 0.0) -> sqlite3.Connection:
    """Errors: sqlite3.Error, ValueError if the file is another kind of database."""
    database = sqlite3.connect(path, timeout=wait_s)
    try:
        database.execute("PRAGMA trusted_schema = OFF")
        version = database.execute("PRAGMA user_version").fetchone()[0]
        tables = set(database.execute("SELECT name, type FROM sqlite_master WHERE name NOT LIKE 'sqlite_%'"))
        if version != _SCHEMA and (version or tables):
            raise ValueError(f"it is of version {version} and not {_SCHEMA}")
        if tables - {("runs", "table")}:
            raise ValueError("it has other tables than the journal's")
        with database:
            database.execute(_TABLE)
            database.execute(f"PRAGMA user_version = {_SCHEMA}")
        _wait(database, LONGEST_WAIT_S)
    except BaseException:
        database.close()
        raise
    return database


def _damaged(path: Path, error: Exception) -> Notice:
    return Notice("journal.damaged", where=Where(str(path.parent)), count=1, first=f"{path.name}: {error}")


def _row(outcome: RunOutcome) -> Sequence[Any]:
    facts: dict[str, Any] = {"failures": [[f.kind.value, f.sentence, f.folder] for f in outcome.failures]}
    modes = outcome.modes
    if modes is None:
        return outcome.key, outcome.state, json.dumps(facts), None, None, None
    facts["mass"] = modes.mass
    if modes.participation is not None:
        facts["participation"] = modes.participation.tolist()
    blobs = (
        np.ascontiguousarray(modes.freq_hz, _REAL).tobytes(),
        np.ascontiguousarray(modes.nodes, _INTEGER).tobytes(),
        np.ascontiguousarray(modes.shapes, _REAL).tobytes(),
    )
    return outcome.key, outcome.state, json.dumps(facts), *blobs


def _outcome(key: str, row: Sequence[Any]) -> RunOutcome:
    """Raises ValueError, TypeError, KeyError if the row is not one of the journal."""
    facts = json.loads(row[0])
    failures = tuple(Failure(FailureKind(kind), str(text), str(folder)) for kind, text, folder in facts["failures"])
    if row[1] is None:
        if not failures:
            raise ValueError("a run without modes and without failure")
        return RunOutcome(key, None, failures)
    freq, nodes = np.frombuffer(row[1], _REAL), np.frombuffer(row[2], _INTEGER)
    shapes = np.frombuffer(row[3], _REAL).reshape(len(nodes), 6, len(freq))
    mass = facts["mass"]
    if not np.isfinite(freq).all() or not (mass is None or isinstance(mass, float)):
        raise ValueError("a run of numbers that are none")
    participation = facts.get("participation")
    if participation is not None:
        participation = np.array(participation, float).reshape(6, len(freq))
    return RunOutcome(key, SolvedModes(freq, nodes, shapes, mass, participation), failures)
