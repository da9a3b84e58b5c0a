"""Measured rows, written one by one, so that a second start goes on where the first one ended."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Row = dict[str, Any]


@dataclass(frozen=True)
class Run:
    """One run of one way."""

    case: str
    size: int
    way: str
    repeat: int


@dataclass(frozen=True)
class Journal:
    """A file of JSON lines."""

    path: Path

    @property
    def rows(self) -> list[Row]:
        """The last row of each run; of a line that was cut by an abrupt end nothing is taken."""
        if not self.path.exists():
            return []
        found = [row for line in self.path.read_text().splitlines() if (row := _row(line))]
        return list({of(row): row for row in found}.values())

    def done(self, run: Run) -> bool:
        """True where this run was measured; one that failed is tried again."""
        return any(of(row) == run and row["status"] != "failed" for row in self.rows)

    def add(self, run: Run, found: Row) -> Row:
        """Write a row at once."""
        row = {**vars(run), **found}
        self.path.parent.mkdir(parents=True, exist_ok=True)
        cut = self.path.exists() and not self.path.read_bytes().endswith(b"\n")
        with self.path.open("a") as out:
            out.write(("\n" if cut else "") + json.dumps(row) + "\n")
        return row

    def reference(self, case: str, size: int) -> Row | None:
        """The first good row of femtune: its frequencies and its shift."""
        good = (r for r in self.rows if (r["case"], r["size"], r["way"]) == (case, size, "femtune") and is_good(r))
        return next(good, None)


def of(row: Row) -> Run:
    """Which run a row is of."""
    return Run(row["case"], row["size"], row["way"], row["repeat"])


def is_good(row: Row) -> bool:
    """True for a row that counts."""
    return bool(row["status"] == "ok")


def _row(line: str) -> Row | None:
    try:
        found = json.loads(line)
    except ValueError:
        return None
    return found if isinstance(found, dict) and "status" in found else None
