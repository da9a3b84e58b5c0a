"""Lines of bulk data put together into cards: continuations, replication, superelement sections."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.files.nastran.card import Card, fields_of
from femtune.files.nastran.fields import FieldLine, beyond_last_column, split_line
from femtune.files.nastran.replication import is_replication, replicate
from femtune.files.nastran.source import SourceLine

_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,7}")
_BEGIN = re.compile(r"\s*BEGIN\b[\s,]*([A-Z]*)\s*=?\s*(\d{0,9})", re.IGNORECASE)
# data in columns 9 to 72 without commas, tabs and comments; at the most a lone + in columns 73 to 80
_PLAIN_COLUMNS = re.compile(r"[^,\t$\r\n]{0,64}(?: {0,7}\+)? *(?:\r\n?|\n)?")
_PLAIN_HEAD = re.compile(r" *[A-Z][A-Z0-9_]* *", re.IGNORECASE)
_PLAIN_CONTINUATIONS = ("        ", "+       ")
_MOST_ERRORS = 20


@dataclass(frozen=True)
class Bulk:
    """Cards in the order of the deck, and what the user should know about their lines."""

    cards: tuple[Card, ...]
    notices: tuple[Notice, ...]


def read_bulk(lines: Iterable[SourceLine]) -> Bulk:
    """Put bulk data lines (without BEGIN BULK and ENDDATA) together into cards.

    Raises
    ------
    FemtuneError : ``deck.too-many-fields``, ``deck.continuation``, ``deck.truncated``, ``deck.card-name``,
        ``deck.replication``; several together as FemtuneErrors
    """
    assembly = _Assembly()
    for line in lines:
        if not assembly.take_plain(line):
            body = line.body
            if body and not body.isspace():
                assembly.take(line, body)
    assembly.finish()
    return Bulk(tuple(assembly.cards), tuple(assembly.notices))


class _Assembly:
    """Cards found so far, and the lines of the card that is being read."""

    def __init__(self) -> None:
        self.cards: list[Card] = []
        self.notices: list[Notice] = []
        self.problems = ErrorCollector()
        self.open: list[FieldLine] = []
        self.plain: list[SourceLine] = []
        self.names: dict[str, str] = {}
        self.superelement = 0

    def take_plain(self, line: SourceLine) -> bool:
        """Take a line in plain columns of small fields, which stays uncut; whether it is one."""
        text = line[2]
        head = text[:8]
        name = self.names.get(head)
        if name is None:
            name = self.names[head] = _plain_name(head)
        if name:
            if _PLAIN_COLUMNS.fullmatch(text, 8) is None:
                return False
            self._close()
            self.plain = [line]
            return True
        if self.plain and head in _PLAIN_CONTINUATIONS and _PLAIN_COLUMNS.fullmatch(text, 8) and not text.isspace():
            self.plain.append(line)
            return True
        return False

    def take(self, line: SourceLine, body: str) -> None:
        with self.problems.catch():
            self._take(line, body)
        if len(self.problems.errors) >= _MOST_ERRORS:
            self.problems.raise_if_any()

    def finish(self) -> None:
        with self.problems.catch():
            if self.open and _asks_for_continuation(self.open[-1].tail):
                raise _cut(self.open)
            self._close()
        self.problems.raise_if_any()

    def _take(self, line: SourceLine, body: str) -> None:
        begin = _BEGIN.match(body) if body.lstrip()[:1] in "bB" else None
        if begin:
            self._close()
            self._begin(line, begin)
            return
        cut = split_line(line, body)
        self._note_width(cut, body)
        if is_replication(cut):
            self._close()
            self._replicate(cut)
        elif cut.continues:
            self._cut_plain()
            self._continue(cut)
        else:
            self._close()
            self.open = [_checked_name(cut)]

    def _continue(self, cut: FieldLine) -> None:
        if not self.open:
            raise _continuation(cut, "this continuation has no card above it", "add the card's first line")
        asked, given = self.open[-1].tail[1:].upper(), cut.head[1:]
        self.open.append(cut)
        if asked and given and asked != given:
            what = f"the card above asks for continuation '{asked}', but '{given}' follows"
            raise _continuation(cut, what, "put a card's continuations right below it, in order")

    def _cut_plain(self) -> None:
        """Cut up the card that is being read, to go on with lines that are not plain."""
        if self.plain:
            lines, self.plain = self.plain, []
            self.open = [split_line(line, line.body) for line in lines]

    def _close(self) -> None:
        if self.plain:
            lines_as_they_are, self.plain = tuple(self.plain), []
            name = self.names[lines_as_they_are[0][2][:8]]
            self.cards.append(
                Card(name, None, lines_as_they_are, "small", len(self.cards), self.superelement, plain=True)
            )
        if not self.open:
            return
        lines, self.open = self.open, []
        self._note_dangling(lines)
        self.cards.append(_card(lines, len(self.cards), self.superelement))

    def _replicate(self, cut: FieldLine) -> None:
        self.cards.extend(replicate(self.cards, cut, self.superelement))

    def _begin(self, line: SourceLine, begin: re.Match[str]) -> None:
        if begin[1].upper() == "BULK" or begin[2] in ("", "0"):
            self.superelement = 0
            return
        self.superelement = int(begin[2])
        what = f"the cards that follow belong to superelement {begin[2]}"
        self.notices.append(Notice("deck.superelement", what, Where(line.file, line.number, "BEGIN SUPER")))

    def _note_width(self, cut: FieldLine, body: str) -> None:
        if beyond_last_column(cut, body):
            where = Where(cut.source.file, cut.source.number, cut.head)
            what = "text after column 80 is not read"
            self.notices.append(Notice("deck.beyond-column-80", what, where))

    def _note_dangling(self, lines: list[FieldLine]) -> None:
        tail = lines[-1].tail
        if _asks_for_continuation(tail):
            where = Where(lines[-1].source.file, lines[-1].source.number, lines[0].head)
            what = f"the continuation '{tail}' that this card asks for does not follow"
            self.notices.append(Notice("deck.dangling-continuation", what, where))


def _card(lines: list[FieldLine], position: int, superelement: int) -> Card:
    sources = tuple(line.source for line in lines)
    name = lines[0].head.removesuffix("*").rstrip()
    return Card(name, fields_of(lines), sources, lines[0].format, position, superelement)


def _plain_name(head: str) -> str:
    """Name of a card whose first line has this in its first eight columns; nothing where the line is not plain."""
    if len(head) < 8 or not _PLAIN_HEAD.fullmatch(head):
        return ""
    name = head.strip().upper()
    return "" if name == "BEGIN" else name


def _checked_name(cut: FieldLine) -> FieldLine:
    if _NAME.fullmatch(cut.head.removesuffix("*").rstrip()):
        return cut
    raise FemtuneError(
        "deck.card-name",
        f"'{cut.head[:20]}' is not the name of a card",
        where=Where(cut.source.file, cut.source.number),
        hint="a name starts with a letter and has 8 letters or digits at most; a comment starts with $",
    )


def _asks_for_continuation(tail: str) -> bool:
    return len(tail) > 1 and tail[0] in "+*"


def _cut(lines: list[FieldLine]) -> FemtuneError:
    last = lines[-1]
    return FemtuneError(
        "deck.truncated",
        f"the deck ends in the middle of a card: its continuation '{last.tail}' is not there",
        where=Where(last.source.file, last.source.number, lines[0].head),
        hint="the file may have been cut here; if the card is complete, remove its last field (columns 73-80)",
    )


def _continuation(cut: FieldLine, what: str, hint: str) -> FemtuneError:
    where = Where(cut.source.file, cut.source.number, cut.head)
    return FemtuneError("deck.continuation", what, where=where, hint=hint)
