"""A bulk data card: its name, its fields as they are written, and the lines that they stand on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import EllipsisType
from typing import Any, overload

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.fields import FieldLine, Format, split_line
from femtune.files.nastran.reals import is_too_large, parse_integer, parse_real
from femtune.files.nastran.source import SourceLine


@dataclass(frozen=True, slots=True)
class Card:
    """One card of the bulk data.

    `position` is the index in `Deck.cards`; `superelement` is 0 for the residual structure; `replicated` marks a
    card that a replication line (``=``) made; `plain` tells that all its lines are plain columns of small
    fields, and `given` are its fields, None until such lines are cut up.
    """

    name: str
    given: tuple[str, ...] | None = field(repr=False, compare=False)
    lines: tuple[SourceLine, ...]
    format: Format
    position: int = 0
    superelement: int = 0
    replicated: bool = False
    plain: bool = False

    @property
    def fields(self) -> tuple[str, ...]:
        """`fields[0]` is field 2 of the first line (what follows the name), `fields[8]` field 2 of the first
        continuation; blank fields at the end are left off and read as blank.
        """
        if self.given is None:
            # most cards of a large deck are read by whole columns and never cut up
            object.__setattr__(self, "given", fields_of([split_line(line, line.body) for line in self.lines]))
        assert self.given is not None
        return self.given

    @property
    def record(self) -> str:
        """Name and first field, as in ``CBAR 12``."""
        return f"{self.name} {self.text(0)}".rstrip()

    def where(self, index: int | None = None) -> Where:
        """Place of the card, or of the line that holds field `index`."""
        line = self.lines[0] if index is None or self.replicated else self._line_of(index)
        return Where(line.file, line.number, self.record)

    def blank(self, index: int) -> bool:
        """Whether field `index` is blank or lies after the last field."""
        return not self.text(index)

    def text(self, index: int, default: str = "") -> str:
        """Field `index` in upper case; `default` where it is blank."""
        fields = self.fields
        return (fields[index].upper() if index < len(fields) else "") or default

    def is_integer(self, index: int) -> bool:
        """Whether field `index` holds an integer."""
        return parse_integer(self.text(index)) is not None

    def is_real(self, index: int) -> bool:
        """Whether field `index` holds a real number."""
        return parse_real(self.text(index)) is not None

    @overload
    def integer(self, index: int) -> int: ...
    @overload
    def integer(self, index: int, default: int) -> int: ...
    @overload
    def integer(self, index: int, default: None) -> int | None: ...
    def integer(self, index: int, default: int | EllipsisType | None = ...) -> int | None:
        """Integer in field `index`; `default` where it is blank (an error without default).

        Raises
        ------
        FemtuneError : ``deck.not-an-integer``, ``deck.blank-field``
        """
        text = self.text(index)
        if not text:
            return self._checked_default(index, default, "an integer")
        value = parse_integer(text)
        if value is None:
            raise self._bad("deck.not-an-integer", index, "an integer", "write it without a decimal point")
        return value

    @overload
    def real(self, index: int) -> float: ...
    @overload
    def real(self, index: int, default: float) -> float: ...
    @overload
    def real(self, index: int, default: None) -> float | None: ...
    def real(self, index: int, default: float | EllipsisType | None = ...) -> float | None:
        """Real number in field `index`; `default` where it is blank (an error without default).

        Raises
        ------
        FemtuneError : ``deck.not-a-real``, ``deck.blank-field``
        """
        text = self.text(index)
        if not text:
            return self._checked_default(index, default, "a real number")
        value = parse_real(text)
        if value is None:
            hint = "correct its exponent" if is_too_large(text) else "a real has a decimal point: 1.5, 2.-3"
            raise self._bad("deck.not-a-real", index, "a real number", hint)
        return value

    def component(self, index: int, default: str = "") -> str:
        """Components (digits 1 to 6, each at most once, or a single 0) in field `index`.

        Raises
        ------
        FemtuneError : ``deck.not-a-component``
        """
        text = self.text(index)
        if not text or text == "0":
            return text or default
        if set(text) <= set("123456") and len(set(text)) == len(text):
            return text
        raise self._bad("deck.not-a-component", index, "a list of components", "write digits 1 to 6: 123")

    def error(self, code: str, what: str, *, index: int | None = None, hint: str = "") -> FemtuneError:
        """An error at this card; with `index` its message names the field and what stands there."""
        values = {} if index is None else self._values(index)
        return FemtuneError(code, what, where=self.where(index), values=values, hint=hint)

    def _checked_default(self, index: int, default: Any, kind: str) -> Any:
        if default is ...:
            raise self._bad("deck.blank-field", index, kind, f"{self.name} has no default here: fill the field")
        return default

    def _bad(self, code: str, index: int, kind: str, hint: str) -> FemtuneError:
        return self.error(code, f"this field should hold {kind}", index=index, hint=hint)

    def _values(self, index: int) -> dict[str, object]:
        line, column = divmod(index, 8)
        field = f"{column + 2}" + (f" of continuation {line}" if line else "")
        text = self.fields[index] if index < len(self.fields) else ""
        return {"field": field, "text": f"'{text}'"}

    def _line_of(self, index: int) -> SourceLine:
        return self.lines[min(self.slot(index)[0], len(self.lines) - 1)]

    def slot(self, index: int) -> tuple[int, int]:
        """Line of the card (may lie beyond its last) and data field of that line which hold field `index`."""
        large = [split_line(line, line.body).large for line in self.lines]
        while index >= line_starts(large)[-1] + (4 if large[-1] else 8):
            large.append(large[-1])
        starts = line_starts(large)
        line = max(number for number, start in enumerate(starts) if start <= index)
        return line, index - starts[line]


def fields_of(lines: Sequence[FieldLine]) -> tuple[str, ...]:
    """All fields of a card from its lines; blank ones at the end are left off."""
    fields: list[str] = []
    for line, start in zip(lines, line_starts([line.large for line in lines])):
        fields += [""] * (start - len(fields))
        fields += line.data
    while fields and not fields[-1]:
        fields.pop()
    return tuple(fields)


def line_starts(large: Sequence[bool]) -> list[int]:
    """Field index at which each line of a card starts, from whether each line is in large field.

    Two large lines make up one line of eight fields; a small line after a lone first half starts the next
    eight.
    """
    starts, at = [], 0
    for wide in large:
        at = at if wide or at % 8 == 0 else at + 4
        starts.append(at)
        at += 4 if wide else 8
    return starts
