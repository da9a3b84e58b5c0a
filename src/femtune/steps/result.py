"""What the results of all steps have in common for Python users: tables, arrays, a representation for notebooks.

A step that treats each configuration separately returns a sequence with one record for each of them; a step on the
whole study returns one record. Tables are `Rows`, which ``pandas.DataFrame`` accepts directly.
"""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar, overload

from numpy.typing import NDArray

from femtune.errors import FemtuneError, did_you_mean
from femtune.study.rows import Rows

if TYPE_CHECKING:
    from pathlib import Path

    from femtune.errors import Notice
    from femtune.steps.results import Results

Arrays = Mapping[str, NDArray[Any]]


class OneConfiguration(Protocol):
    """A record of one configuration."""

    @property
    def configuration(self) -> str:
        """Name of the configuration."""
        ...


R = TypeVar("R", bound=OneConfiguration)


_MOST_LINES = 7
"""Lines of a result as text in a notebook; a last line gives the number of the others."""
_LONGEST_LINE = 160
"""Characters in a line of a result as text; a longer line is cut."""


class StepResult(ABC):
    """Base of the results of steps: a short `repr`, and a table in a notebook."""

    @abstractmethod
    def _sentences(self) -> list[str]:
        """Its sentences, the most important first."""

    @abstractmethod
    def _table(self) -> Rows:
        """The table that a notebook shows."""

    def __repr__(self) -> str:
        lines = [
            f"{type(self).__name__}: {text}" if i == 0 else f"  {text}" for i, text in enumerate(self._sentences())
        ]
        more = len(lines) - _MOST_LINES
        return "\n".join([*lines[:_MOST_LINES], *([f"  … and {more} more"] if more > 0 else [])])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(repr(self))}</pre>{self._table()._repr_html_()}"


class ResultWithPage(StepResult):
    """Base of the results of steps that have a page of their own.

    `page` is the field of `results` with the record of the step, by which its page is found; `arrays` are the arrays by
    key, `report` the page that was written, None without one.
    """

    page: ClassVar[str]
    results: Results
    arrays: Arrays
    report: Path | None


def _one_line(text: str) -> str:
    return text if len(text) <= _LONGEST_LINE else text[: _LONGEST_LINE - 1] + "…"


@dataclass(frozen=True, eq=False, repr=False)
class OfConfigurations(StepResult, Sequence[R], Generic[R]):
    """One record a configuration: by position, or by the name of the configuration.

    `records` are those of results.json, `remarks` are notices beside the result: what the reader of the deck warns of,
    and how many solutions came from the journal of an earlier run. Each has `code`, `level` and `what`; `str` gives its
    text.
    """

    records: tuple[R, ...]
    remarks: tuple[Notice, ...] = field(default=(), kw_only=True)

    @overload
    def __getitem__(self, which: int | str) -> R: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[R, ...]: ...
    def __getitem__(self, which: int | str | slice) -> R | tuple[R, ...]:
        return self.records[which if isinstance(which, int | slice) else self._position(which)]

    def __len__(self) -> int:
        return len(self.records)

    @property
    def configurations(self) -> tuple[str, ...]:
        """Names of the configurations, in the order of the study."""
        return tuple(record.configuration for record in self.records)

    def _position(self, name: str) -> int:
        if name not in self.configurations:
            raise FemtuneError(
                "study.unknown-configuration/no-result", hint=did_you_mean(name, self.configurations), name=name
            )
        return self.configurations.index(name)

    def _only(self, word: str) -> R:
        """The record where there is a single configuration."""
        if len(self.records) == 1:
            return self.records[0]
        code = "study.unknown-configuration/several" if self.records else "study.unknown-configuration/no-results"
        values = {"configurations": ", ".join(self.configurations)}
        raise FemtuneError(code, values=values, count=len(self.records), property=word)
