"""Errors and notices: what, where, the values, and the smallest fix, each with a stable code.

A code is ``area.problem`` (``deck.missing-include``); ``docs/errors/`` has a page for each.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Where:
    """A place in a file: line numbers start at 1; `record` names a card, data set or key."""

    file: str = ""
    line: int | None = None
    record: str = ""

    def __str__(self) -> str:
        place = ":".join(part for part in (self.file, str(self.line or "")) if part)
        return f"{place} ({self.record})" if place and self.record else place or self.record


class FemtuneError(Exception):
    """A problem that the user can mend.

    Parameters
    ----------
    code : stable code, ``area.problem``
    what : one sentence that says what is wrong
    where : file, line and record
    values : the values at fault, by name
    hint : the smallest fix
    """

    def __init__(
        self,
        code: str,
        what: str,
        *,
        where: Where | None = None,
        values: dict[str, Any] | None = None,
        hint: str = "",
    ) -> None:
        super().__init__(what)
        self.code, self.what, self.where = code, what, where
        self.values, self.hint = dict(values or {}), hint

    def __str__(self) -> str:
        lines = [f"[{self.code}] {self.what}"]
        if str(self.where or ""):
            lines.append(f"  at {self.where}")
        lines += [f"  {name} = {value}" for name, value in self.values.items()]
        if self.hint:
            lines += ["", f"hint: {self.hint}"]
        return printable("\n".join(lines))


class FemtuneErrors(FemtuneError):  # noqa: N818
    """Several problems found in one pass, shown together."""

    def __init__(self, errors: Iterable[FemtuneError]) -> None:
        self.errors = tuple(errors)
        super().__init__(self.errors[0].code, f"{len(self.errors)} problems found")

    def __str__(self) -> str:
        return "\n\n".join([f"{len(self.errors)} problems:", *map(str, self.errors)])


class _Catching(AbstractContextManager[None]):
    """The block of `ErrorCollector.catch`; plain methods, since a deck enters it once for each card."""

    __slots__ = ("errors",)

    def __init__(self, errors: list[FemtuneError]) -> None:
        self.errors = errors

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> bool:
        if isinstance(error, FemtuneError):
            self.errors.extend(error.errors if isinstance(error, FemtuneErrors) else [error])
            return True
        return False


@dataclass
class ErrorCollector:
    """Gathers errors so that a set-up shows all of them at once."""

    errors: list[FemtuneError] = field(default_factory=list)

    def catch(self) -> AbstractContextManager[None]:
        """Keep a FemtuneError raised inside the block and go on."""
        return _Catching(self.errors)

    def raise_if_any(self) -> None:
        """Raise what was gathered: the error itself if it is alone, else all of them."""
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            raise FemtuneErrors(self.errors)


@dataclass(frozen=True)
class Notice:
    """Something that the user should know and that does not stop the work.

    `level` is "info" or "warning".
    """

    code: str
    what: str
    where: Where | None = None
    level: str = "warning"

    def __str__(self) -> str:
        place = f" at {self.where}" if str(self.where or "") else ""
        return printable(f"[{self.code}] {self.what}{place}")


def printable(text: str) -> str:
    """`text` with control characters spelled out, so that what a file holds cannot steer a terminal."""
    return "".join(c if c.isprintable() or c == "\n" else ascii(c)[1:-1] for c in text)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A sentence naming the closest known word, or the list of them when nothing is close; "" without any."""
    known = sorted(set(known))
    if not known:
        return ""
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean '{close[0]}'?" if close else "known: " + ", ".join(known)
