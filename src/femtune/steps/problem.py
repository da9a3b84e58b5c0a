"""Errors and notices as records: what `femtune check` lists, and what a command that fails prints as JSON."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from femtune.errors import FemtuneError, FemtuneErrors, Notice, Where, printable
from femtune.study.record import Record


class FoundProblem(Record):
    """A mistake, or a remark."""

    level: Literal["error", "warning", "info"]
    """An error stops every step; a warning should be looked at."""
    code: str
    """Stable code; `femtune explain` explains it."""
    message: str
    """What is wrong, in one sentence."""
    file: str
    """The file; "" if it is in none."""
    line: int | None
    """Line of the file, from 1; None if it has none."""
    values: dict[str, str]
    """The values at fault, by name."""
    hint: str
    """The smallest fix; "" if none is known."""


class CommandFailure(Record):
    """Why a command has failed."""

    exit_code: int
    """Exit code of the command."""
    code: str
    """Stable code, of the first error if there are several; "" for wrong options, interruptions and internal errors."""
    message: str
    """What is wrong, in one sentence."""
    file: str = ""
    """The file; "" if it is in none."""
    line: int | None = None
    """Line of the file, from 1; None if it has none."""
    record: str = ""
    """Card, data set or key at that place; "" if none is named."""
    values: dict[str, str] = Field(default_factory=dict)
    """The values at fault, by name."""
    hint: str = ""
    """The smallest fix; "" if none is known."""
    notes: tuple[str, ...] = ()
    """Notices from before the error, often its cause."""
    problems: tuple[FoundProblem, ...] = ()
    """All errors, if several were found together."""


def problem_of_error(error: FemtuneError) -> FoundProblem:
    """An error as a record."""
    where = error.where or Where()
    return FoundProblem(
        level="error", code=error.code, message=printable(error.what), file=printable(where.file), line=where.line,
        values=_texts(error), hint=printable(error.hint),
    )  # fmt: skip


def problem_of_notice(notice: Notice) -> FoundProblem:
    """A notice as a record."""
    where = notice.where or Where()
    return FoundProblem(
        level="warning", code=notice.code, message=printable(notice.what), file=printable(where.file),
        line=where.line, values={}, hint="",
    )  # fmt: skip


def failure_of(error: FemtuneError, exit_code: int) -> CommandFailure:
    """What a command that ends with an error has to say; of several errors the place of the first one."""
    problems = error.errors if isinstance(error, FemtuneErrors) else ()
    first = problems[0] if problems else error
    where = first.where or Where()
    notes = dict.fromkeys((*map(str, error.notices), *getattr(error, "__notes__", ())))
    return CommandFailure(
        exit_code=exit_code, code=error.code, message=printable(error.what), file=printable(where.file),
        line=where.line, record=printable(where.record), values=_texts(first), hint=printable(first.hint),
        notes=tuple(map(printable, notes)), problems=tuple(map(problem_of_error, problems)),
    )  # fmt: skip


def _texts(error: FemtuneError) -> dict[str, str]:
    return {name: printable(str(value)) for name, value in error.values.items()}
