"""Lines of bulk data assembled into cards: continuations, replication, superelement sections."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Any

from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.files.nastran.card import Card, fields_of
from femtune.files.nastran.lines import (
    FieldLine,
    beyond_last_column,
    format_real,
    parse_integer,
    parse_real,
    split_line,
)
from femtune.files.nastran.source import SourceLine

# ----------------------------------------------------------------------------------------------------
# Replication: a line that starts with ``=`` repeats the card above with some fields changed.
#
# ``=`` in a data field repeats that field, ``==`` that field and all after it, ``*(i)`` adds i to it; ``=(n)`` or
# ``=n`` in the first field makes n more cards in the same way.


_HEAD = re.compile(r"=(?:\(?(\d{1,5})\)?)?")
_INCREMENT = re.compile(r"\*\(?([^()*]+)\)?")


def is_replication(cut: FieldLine) -> bool:
    """Whether a line repeats the card above, or fields of it after another card name."""
    return cut.head.startswith("=") or (not cut.continues and any(text in ("=", "==") for text in cut.data))


def replicate(cards: Sequence[Card], cut: FieldLine, superelement: int) -> list[Card]:
    """Cards that a replication line generates.

    Raises
    ------
    FemtuneError : ``deck.replication``
    """
    named = cut.head.removesuffix("*").rstrip() if not cut.head.startswith("=") else ""
    head = _HEAD.fullmatch("=" if named else cut.head)
    if not cards:
        raise _error(cut, "deck.replication/no-card")
    if head is None:
        raise _error(cut, "deck.replication/unknown")
    parent = cards[-1]
    if len(parent.lines) > 1:
        raise _error(cut, "deck.replication")
    if named and named != parent.name:
        raise _error(cut, "deck.replication/other-card", name=named, above=parent.name)
    count, rule = int(head[1] or 1), cut
    if head[1] and not any(cut.data):
        rule = _rule_above(parent, cut)
    made = [parent]
    for _ in range(count):
        made.append(_next(made[-1], rule, cut, len(cards) + len(made) - 1, superelement))
    return made[1:]


def _rule_above(parent: Card, cut: FieldLine) -> FieldLine:
    if not parent.replicated:
        raise _error(cut, "deck.replication/no-rule")
    rule = parent.lines[0]
    return split_line(rule, rule.body)


def _next(previous: Card, rule: FieldLine, cut: FieldLine, position: int, superelement: int) -> Card:
    before = [*previous.fields, *[""] * (len(rule.data) - len(previous.fields))]
    fields: list[str] = []
    for index, text in enumerate(rule.data):
        if text == "==":
            fields += before[index:]
            break
        fields.append(_field(before[index], text, cut))
    while fields and not fields[-1]:
        fields.pop()
    card = replace(previous, given=tuple(fields), lines=(cut.source,), position=position, plain=False)
    return replace(card, replicated=True, superelement=superelement, format=cut.format)


def _field(before: str, text: str, cut: FieldLine) -> str:
    if text == "=":
        return before
    increment = _INCREMENT.fullmatch(text)
    return _sum(before, increment[1], cut) if increment else text


def _sum(before: str, step: str, cut: FieldLine) -> str:
    whole, whole_step = parse_integer(before), parse_integer(step)
    if whole is not None and whole_step is not None:
        return str(whole + whole_step)
    real, real_step = parse_real(before), parse_real(step)
    if real is None or real_step is None:
        raise _error(cut, "deck.replication/increment", step=step, before=before)
    return format_real(float(Decimal(repr(real)) + Decimal(repr(real_step))), 16)


def _error(cut: FieldLine, code: str, **facts: Any) -> FemtuneError:
    where = Where(cut.source.file, cut.source.number, cut.head)
    return FemtuneError(code, where=where, **facts)


_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,7}")
# BEGIN BULK, BEGIN SUPER = 2, BEGIN BULK SUPER = 2, BEGIN SUPER = 2 MASSID = 3
_BEGIN = re.compile(r"\s*BEGIN\b", re.IGNORECASE)
_SUPER = re.compile(r"\bSUPER\b[\s=]*([^\s,$]*)", re.IGNORECASE)
_PART_NUMBER = re.compile(r"[0-9]{1,9}")
# mass increments, auxiliary models, contact and module data
_ASIDE = re.compile(r"\b(?:MASSID|AUXMODEL|ARBMODEL|FLXBDY|MODULE|TRMC|UDS)\b", re.IGNORECASE)
_NOT_OF_THE_MODEL = -1
"""Number in place of a superelement's for cards in sections that are not part of the model."""
# data in columns 9 to 72 without commas, tabs and comments; at the most a lone + in columns 73 to 80
_PLAIN_COLUMNS = re.compile(r"[^,=\t$\r\n]{0,64}(?: {0,7}\+)? *(?:\r\n?|\n)?")
_PLAIN_HEAD = re.compile(r" *[A-Z][A-Z0-9_]* *", re.IGNORECASE)
_PLAIN_CONTINUATIONS = ("        ", "+       ")
# an equation is free text that ends before the next line that starts in column 1
_FREE_TEXT = re.compile(r" {0,7}(DEQATN)\*?(?=[\s,])[\s,]*(\d*)", re.IGNORECASE)
_TEXT_GOES_ON = re.compile(r"[ \t+*,]")
_MOST_ERRORS = 20
"""Number of errors after which reading stops; a file that is not bulk data has one in every line."""


@dataclass(frozen=True)
class Bulk:
    """Cards in the order of the deck, notices about their lines, and BEGIN SUPER lines by number.

    `aside` are the BEGIN lines of sections that are not part of the model.
    """

    cards: tuple[Card, ...]
    notices: tuple[Notice, ...]
    parts: Mapping[int, SourceLine]
    aside: tuple[SourceLine, ...] = ()


def read_bulk(lines: Iterable[SourceLine]) -> Bulk:
    """Assemble bulk data lines (without BEGIN BULK and ENDDATA) into cards.

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
    parts = {number: line for number, line in assembly.begins.items() if number}
    return Bulk(tuple(assembly.cards), tuple(assembly.notices), parts, tuple(assembly.aside))


class _Assembly:
    """Cards found so far, and the lines of the card that is being read."""

    def __init__(self) -> None:
        self.cards: list[Card] = []
        self.notices: list[Notice] = []
        self.problems = ErrorCollector()
        self.open: list[FieldLine] = []
        self.plain: list[SourceLine] = []
        self.names: dict[str, str] = {}
        self.text: list[SourceLine] = []
        self.superelement = 0
        self.begins: dict[int, SourceLine] = {}
        self.aside: list[SourceLine] = []
        self.asking: list[_Part] = []
        self.apart: list[_Part] = []

    def take_plain(self, line: SourceLine) -> bool:
        """Take a line in plain columns of small fields without splitting it; False if it is another line."""
        text = line[2]
        head = text[:8]
        name = self.names.get(head)
        if name is None:
            name = self.names[head] = plain_name(head)
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
            self._close()
        self._join()
        self.problems.raise_if_any()

    def _take(self, line: SourceLine, body: str) -> None:
        if self._take_text(line, body):
            return
        begin = _BEGIN.match(body) if body.lstrip()[:1] in "bB" else None
        if begin:
            self._close()
            self._begin(line, body)
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

    def _take_text(self, line: SourceLine, body: str) -> bool:
        """Take a line of a card of free text, which has no fields; False if it is another line."""
        if self.text and _TEXT_GOES_ON.match(body):
            self.text.append(line)
            return True
        if _FREE_TEXT.match(body) is None:
            return False
        self._close()
        self.text = [line]
        return True

    def _continue(self, cut: FieldLine) -> None:
        above = self.open[-1] if self.open else None
        if above is not None and (not cut.head[1:] or _is_named_by(above, cut)):
            self.open.append(cut)
        elif cut.head[1:]:
            # Nastran finds the card of a continuation by its name, anywhere in the deck
            self._close()
            self.open = [cut]
        else:
            raise _continuation(cut, "deck.continuation")

    def _cut_plain(self) -> None:
        """Split the lines of the card that is being read, because the next line is not plain."""
        if self.plain:
            lines, self.plain = self.plain, []
            self.open = [split_line(line, line.body) for line in lines]

    def _close(self) -> None:
        if self.text:
            head = _FREE_TEXT.match(self.text[0].body)
            given = (head[2],) if head else ()
            text, self.text = tuple(self.text), []
            self.cards.append(Card("DEQATN", given, text, "small", len(self.cards), self.superelement))
        if self.plain:
            lines_as_they_are, self.plain = tuple(self.plain), []
            name = self.names[lines_as_they_are[0][2][:8]]
            self.cards.append(
                Card(name, None, lines_as_they_are, "small", len(self.cards), self.superelement, plain=True)
            )
        if not self.open:
            return
        lines, self.open = self.open, []
        if lines[0].continues:
            above = self.cards[-1].record if self.cards else ""
            self.apart.append(_Part(lines, self.superelement, above=above))
            return
        if lines[-1].tail:
            self.asking.append(_Part(lines, self.superelement, len(self.cards)))
        self.cards.append(_card(lines, len(self.cards), self.superelement))

    def _join(self) -> None:
        """Attach continuations that do not follow their card to the line that names them."""
        asking = [*self.asking, *self.apart]
        by_name: dict[tuple[int, str], list[_Part]] = {}
        for part in asking if self.apart else ():
            for name in _names(part.lines[-1].tail):
                by_name.setdefault((part.superelement, name), []).append(part)
        for part in self.apart:
            with self.problems.catch():
                _parent(part, by_name).followers.append(part)
        for part in self.asking:
            with self.problems.catch():
                self._with_followers(part)
        if not self.problems.errors:
            # continuations that name each other in a circle
            for part in [part for part in self.apart if not part.joined][:1]:
                self.problems.errors.append(_no_parent(part))

    def _with_followers(self, part: _Part) -> None:
        lines, last = list(part.lines), part
        while last.followers:
            if len(last.followers) > 1:
                second = last.followers[1].lines[0]
                raise _continuation(second, "deck.continuation/repeated", found=second.head[1:])
            last = last.followers[0]
            last.joined = True
            lines += last.lines
        if len(lines) > len(part.lines):
            following = self.cards[part.card + 1 : part.card + 2]
            if any(card.replicated for card in following):
                raise FemtuneError("deck.replication", where=following[0].where())
            self.cards[part.card] = _card(lines, part.card, part.superelement)
        tail = lines[-1].tail
        if _asks_for_continuation(tail):
            if part.card == len(self.cards) - 1 and not self.apart:
                raise _cut(lines)
            where = Where(lines[-1].source.file, lines[-1].source.number, lines[0].head)
            self.notices.append(Notice("deck.dangling-continuation", where=where, continuation_name=tail))

    def _replicate(self, cut: FieldLine) -> None:
        self.cards.extend(replicate(self.cards, cut, self.superelement))

    def _begin(self, line: SourceLine, body: str) -> None:
        if _ASIDE.search(body):
            self.superelement = _NOT_OF_THE_MODEL
            self.aside.append(line)
            return
        part, where = _SUPER.search(body), Where(line.file, line.number, body.strip())
        if part and not _PART_NUMBER.fullmatch(part[1]):
            self.superelement = _NOT_OF_THE_MODEL
            raise FemtuneError("deck.superelement/number", where=where, text=part[1] or "blank")
        self.superelement = int(part[1]) if part else 0
        first = self.begins.setdefault(self.superelement, line)
        if self.superelement and first is not line:
            again = Notice("deck.superelement/again", where=where, number=self.superelement, line=first.number)
            self.notices.append(again)

    def _note_width(self, cut: FieldLine, body: str) -> None:
        if beyond_last_column(cut, body):
            where = Where(cut.source.file, cut.source.number, cut.head)
            self.notices.append(Notice("deck.beyond-column-80", where=where))


@dataclass(eq=False)
class _Part:
    """Lines of a card, or continuations that do not follow their card.

    `card` is the position of the card, `above` the card that the continuations follow, `followers` are those named
    in field 10 of the last line.
    """

    lines: list[FieldLine]
    superelement: int
    card: int = -1
    above: str = ""
    followers: list[_Part] = field(default_factory=list)
    joined: bool = False


def _names(tail: str) -> set[str]:
    """Names of the continuation that field 10 requests.

    Column 73 is arbitrary: ``+A`` there requests A. A name in columns 74 to 80 may itself begin with a plus.
    """
    tail = tail.upper()
    return {tail[1:], tail} - {""}


def _is_named_by(above: FieldLine, cut: FieldLine) -> bool:
    return cut.head[1:] in _names(above.tail)


def _parent(part: _Part, by_name: dict[tuple[int, str], list[_Part]]) -> _Part:
    """The part whose last line names these continuations."""
    parents = by_name.get((part.superelement, part.lines[0].head[1:]), [])
    if len(parents) == 1:
        return parents[0]
    if not parents:
        raise _no_parent(part)
    places = " and ".join(f"{p.lines[-1].source.file}:{p.lines[-1].source.number}" for p in parents[:2])
    raise _continuation(part.lines[0], "deck.continuation/ambiguous", found=part.lines[0].head[1:], places=places)


def _no_parent(part: _Part) -> FemtuneError:
    above = f"the card above it is {part.above}" if part.above else "no card stands above it"
    return _continuation(part.lines[0], "deck.continuation/other-name", found=part.lines[0].head[1:], above=above)


def _card(lines: list[FieldLine], position: int, superelement: int) -> Card:
    sources = tuple(line.source for line in lines)
    name = lines[0].head.removesuffix("*").rstrip()
    return Card(name, fields_of(lines), sources, lines[0].format, position, superelement)


def plain_name(head: str) -> str:
    """Name of a card from the first eight columns of its first line; empty if the line is not plain."""
    if len(head) < 8 or not _PLAIN_HEAD.fullmatch(head):
        return ""
    name = head.strip().upper()
    return "" if name in ("BEGIN", "DEQATN") else name


def _checked_name(cut: FieldLine) -> FieldLine:
    if _NAME.fullmatch(cut.head.removesuffix("*").rstrip()):
        return cut
    raise FemtuneError("deck.card-name", where=Where(cut.source.file, cut.source.number), head=cut.head[:20])


def _asks_for_continuation(tail: str) -> bool:
    return len(tail) > 1 and tail[0] in "+*"


def _cut(lines: list[FieldLine]) -> FemtuneError:
    last = lines[-1]
    return FemtuneError(
        "deck.truncated", where=Where(last.source.file, last.source.number, lines[0].head), continuation_name=last.tail
    )


def _continuation(cut: FieldLine, code: str, **facts: Any) -> FemtuneError:
    return FemtuneError(code, where=Where(cut.source.file, cut.source.number, cut.head), **facts)
