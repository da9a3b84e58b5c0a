"""A bulk data card: its name, its fields as written, and their lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import EllipsisType
from typing import Any, overload

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.lines import (
    FieldLine,
    Format,
    is_too_large,
    parse_integer,
    parse_number,
    parse_real,
    split_line,
)
from femtune.files.nastran.source import SourceLine


@dataclass(frozen=True, slots=True)
class Card:
    """One card of the bulk data.

    `position` is the index in `Deck.cards`; `superelement` is 0 for the residual structure; `replicated` marks a
    card that a replication line (``=``) made; `plain` is True if all its lines are plain columns of small
    fields, and `given` are its fields, None until such lines are split. `without_point` is a field that was read as a
    real number although it has no decimal point.
    """

    name: str
    given: tuple[str, ...] | None = field(repr=False, compare=False)
    lines: tuple[SourceLine, ...]
    format: Format
    position: int = 0
    superelement: int = 0
    replicated: bool = False
    plain: bool = False
    without_point: int | None = field(default=None, repr=False, compare=False)

    @property
    def fields(self) -> tuple[str, ...]:
        """`fields[0]` is field 2 of the first line (what follows the name), `fields[8]` field 2 of the first
        continuation; trailing blank fields are omitted and read as blank.
        """
        if self.given is None:
            # most cards of a large deck are read by whole columns and never split
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
        """Whether field `index` is blank or after the last field."""
        return not self.text(index)

    def text(self, index: int, default: str = "") -> str:
        """Field `index` in upper case; `default` if it is blank."""
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
        """Integer in field `index`; `default` if it is blank (an error without default).

        Raises
        ------
        FemtuneError : ``deck.not-an-integer``, ``deck.blank-field``
        """
        text = self.text(index)
        if not text:
            return self._checked_default(index, default, "deck.blank-field/integer")
        value = parse_integer(text)
        if value is None:
            raise self.error("deck.not-an-integer", index=index)
        return value

    @overload
    def real(self, index: int) -> float: ...
    @overload
    def real(self, index: int, default: float) -> float: ...
    @overload
    def real(self, index: int, default: None) -> float | None: ...
    def real(self, index: int, default: float | EllipsisType | None = ...) -> float | None:
        """Real number in field `index`; `default` if it is blank (an error without default).

        Raises
        ------
        FemtuneError : ``deck.not-a-real``, ``deck.blank-field``
        """
        text = self.text(index)
        if not text:
            return self._checked_default(index, default, "deck.blank-field/real")
        value = parse_real(text)
        if value is not None:
            return value
        value = parse_number(text)
        if value is None:
            code = "deck.not-a-real/too-large" if is_too_large(text) else "deck.not-a-real"
            raise self.error(code, index=index)
        if self.without_point is None or value:
            # for the single notice of the deck, in which zeros matter least
            object.__setattr__(self, "without_point", index)
        return value

    def component(self, index: int, default: str = "") -> str:
        """Components (digits 1 to 6, each at most once, also with blanks between, or a single 0) in field `index`.

        Raises
        ------
        FemtuneError : ``deck.not-a-component``
        """
        text = "".join(self.text(index).split())
        if not text or text == "0":
            return text or default
        if set(text) <= set("123456") and len(set(text)) == len(text):
            return text
        raise self.error("deck.not-a-component", index=index)

    def error(self, code: str, *, index: int | None = None, hint: str | None = None, **facts: Any) -> FemtuneError:
        """An error at this card; with `index` its message names the field and its content."""
        values = {} if index is None else self._values(index)
        return FemtuneError(code, where=self.where(index), values=values, hint=hint, **facts)

    def field_name(self, index: int) -> str:
        """Number of a field as in the manuals: ``field 5``, ``field 2 of continuation 1``."""
        line, column = divmod(index, 8)
        return f"field {column + 2}" + (f" of continuation {line}" if line else "")

    def _checked_default(self, index: int, default: Any, code: str) -> Any:
        if default is ...:
            raise self.error(code, index=index, card=self.name)
        return default

    def _values(self, index: int) -> dict[str, object]:
        text = self.fields[index] if index < len(self.fields) else ""
        return {"field": self.field_name(index).removeprefix("field "), "text": f"'{text}'"}

    def _line_of(self, index: int) -> SourceLine:
        return self.lines[min(self.slot(index)[0], len(self.lines) - 1)]

    def slot(self, index: int) -> tuple[int, int]:
        """Line of the card (possibly beyond its last) and data field of that line that hold field `index`."""
        sizes = [split_line(line, line.body).size for line in self.lines]
        while index >= line_starts(sizes)[-1] + sizes[-1][1]:
            large = sizes[-1][0]
            sizes.append((large, 4 if large else 8))
        starts = line_starts(sizes)
        line = max(number for number, start in enumerate(starts) if start <= index)
        return line, index - starts[line]


def fields_of(lines: Sequence[FieldLine]) -> tuple[str, ...]:
    """All fields of a card from its lines, without trailing blank ones."""
    fields: list[str] = []
    for line, start in zip(lines, line_starts([line.size for line in lines])):
        fields += [""] * (start - len(fields))
        fields += line.data
    while fields and not fields[-1]:
        fields.pop()
    return tuple(fields)


def line_starts(sizes: Sequence[tuple[bool, int]]) -> list[int]:
    """Field index at which each line of a card starts; `sizes` are `FieldLine.size` of the lines.

    Two large lines make up one line of eight fields; a small line after a lone first half starts the next
    eight.
    """
    starts, at = [], 0
    for large, count in sizes:
        at = at if large or at % 8 == 0 else at + 4
        starts.append(at)
        at += count
    return starts


# ----------------------------------------------------------------------------------------------------
# CardEntry: a card read by the names of its fields, with the defaults that another card gives.


LARGEST_COORDINATE = 1e30
"""Largest magnitude of a coordinate; squares and products of coordinates do not overflow."""


@dataclass(frozen=True)
class CardEntry:
    """A card, or one of the entries of a card that holds several.

    Parameters
    ----------
    card : the card
    names : names of the fields, from position `start` of the card
    start : position of the first name
    defaults : record whose fields replace blank ones (GRDSET, BAROR, BEAMOR)
    """

    card: Card
    names: tuple[str, ...]
    start: int = 0
    defaults: CardEntry | None = None

    @property
    def name(self) -> str:
        """Name of the card."""
        return self.card.name

    @property
    def where(self) -> Where:
        """Place of the card."""
        return self.card.where()

    def at(self, name: str) -> int:
        """Index of a field in the card."""
        return self.start + self.names.index(name)

    def blank(self, name: str) -> bool:
        """Whether a field is blank, here and in the defaults."""
        return self._source(name).card.blank(self.at(name))

    def has_integer(self, name: str) -> bool:
        """Whether a field holds an integer."""
        return self._source(name).card.is_integer(self.at(name))

    def integer(self, name: str, default: int | EllipsisType | None = ...) -> Any:
        """Integer in a field; a blank field without default is an error."""
        return self._source(name).card.integer(self.at(name), default)  # type: ignore[arg-type]

    def real(self, name: str, default: float | EllipsisType | None = ...) -> Any:
        """Real number in a field; a blank field without default is an error."""
        return self._source(name).card.real(self.at(name), default)  # type: ignore[arg-type]

    def reals(self, *names: str) -> list[float]:
        """Components of a point or vector, 0 if blank (error ``deck.field-value`` if too large)."""
        values = [self.real(name, 0.0) for name in names]
        for name, x in zip(names, values):
            if abs(x) > LARGEST_COORDINATE:
                raise self.error("deck.field-value/coordinate", at=name)
        return values

    def text(self, name: str, default: str = "") -> str:
        """Text in a field, upper case."""
        return self._source(name).card.text(self.at(name), default)

    def component(self, name: str, default: str = "") -> str:
        """Components in a field."""
        return self._source(name).card.component(self.at(name), default)

    def error(self, code: str, *, at: str | None = None, hint: str | None = None, **facts: Any) -> FemtuneError:
        """An error at this card, or at one of its fields."""
        return self.card.error(code, index=None if at is None else self.at(at), hint=hint, **facts)

    def _source(self, name: str) -> CardEntry:
        if self.defaults is None or name not in self.defaults.names or not self.card.blank(self.at(name)):
            return self
        return self.defaults


def records_of(card: Card, defaults: CardEntry | None = None) -> list[CardEntry]:
    """The entries of a card; blank ones after the first are left out."""
    kind = CATALOGUE[card.name]
    return [
        CardEntry(card, kind.fields, start, defaults)
        for start in kind.starts
        if start == 0 or not card.blank(start)
    ]  # fmt: skip
