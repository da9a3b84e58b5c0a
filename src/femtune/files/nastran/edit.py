"""Changes to a deck: values of fields, new cards, cards rewritten in large field. All else is unchanged."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral

from femtune.errors import ErrorCollector, FemtuneError, Where
from femtune.files.nastran.assembly import read_bulk
from femtune.files.nastran.card import Card, line_starts
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.lines import (
    CardLayout,
    Value,
    field_width,
    format_real,
    layout_of,
    new_card_lines,
    new_line,
    parse_number,
    rounded,
    split_line,
    value_text,
    with_field,
)
from femtune.files.nastran.source import SourceFile, SourceLine

_LARGE = CardLayout("large", True)
Edits = Mapping[tuple[int, int], float | int | str]


@dataclass(frozen=True)
class NewCard:
    """A card to be inserted directly after the card at position `after`, in that card's format."""

    after: int
    name: str
    fields: tuple[Value, ...]


@dataclass(frozen=True)
class FieldChange:
    """One field that was changed: its place, and its text before and after."""

    position: int
    index: int
    where: Where
    before: str
    after: str


@dataclass(frozen=True)
class EditedDeck:
    """A deck with changed lines.

    `replacements` holds the new text of each changed line by file and line number; `changes` the changed fields;
    `values` the number that will be read back from the field of each real-valued edit.
    """

    deck: Deck
    replacements: Mapping[tuple[str, int], str]
    changes: tuple[FieldChange, ...]
    values: Mapping[tuple[int, int], float]

    @property
    def texts(self) -> dict[str, str]:
        """New text of each changed file, by file."""
        changed = {file for file, _ in self.replacements}
        return {file.file: new_text(file, self.replacements) for file in self.deck.files if file.file in changed}


def new_text(file: SourceFile, replacements: Mapping[tuple[str, int], str]) -> str:
    """Text of a file with some of its lines replaced."""
    lines = (replacements.get((line.file, line.number), line.text) for line in file.lines)
    return file.prefix + "".join(lines)


def edit_fields(deck: Deck, edits: Edits, *, new_cards: Sequence[NewCard] = (), wide: bool = False) -> EditedDeck:
    """Change fields and add cards; every byte outside of these fields is kept.

    Parameters
    ----------
    edits : new value by (card position, field index): a float is written as the closest real number that fits
        in the field, an int and a str literally. A field that already has the value is not changed.
    new_cards : cards to add
    wide : rewrite a card in large field if a real does not fit exactly in its field

    Raises
    ------
    FemtuneError : ``write.replicated``, ``write.included-twice``, ``write.too-wide``, ``write.not-finite``,
        ``write.not-read-back``; several together as FemtuneErrors
    """
    editing = _Editing(deck, wide)
    for position, values in sorted(_by_card(edits).items()):
        with editing.problems.catch():
            editing.change(deck.cards[position], values)
    for new in new_cards:
        with editing.problems.catch():
            editing.insert(deck.cards[new.after], new)
    editing.problems.raise_if_any()
    return EditedDeck(deck, editing.replacements, tuple(editing.changes), editing.values)


def _by_card(edits: Edits) -> dict[int, dict[int, float | int | str]]:
    by_card: dict[int, dict[int, float | int | str]] = {}
    for (position, index), value in edits.items():
        by_card.setdefault(position, {})[index] = value
    return by_card


class _Editing:
    """Replacements as they are gathered card by card."""

    def __init__(self, deck: Deck, wide: bool) -> None:
        self.deck, self.wide = deck, wide
        self.problems = ErrorCollector()
        self.replacements: dict[tuple[str, int], str] = {}
        self.changes: list[FieldChange] = []
        self.values: dict[tuple[int, int], float] = {}
        self.uses = Counter(card.lines[0][:2] for card in deck.cards if not card.replicated)
        self.endings = {file.file: file.lines[0].ending or "\n" for file in deck.files if file.lines}

    def change(self, card: Card, values: dict[int, float | int | str]) -> None:
        self._check_editable(card)
        needed = {index: value for index, value in values.items() if not _already(card, index, value)}
        self._note_values(card, values)
        if not needed:
            return
        widen = self.wide and any(_is_cut(card, index, value) for index, value in needed.items())
        texts = _texts(card, needed, widen)
        lines = _widened(card, texts) if widen else _edited(card, texts)
        _check_read_back(card, texts, lines)
        self._replace(card, lines)
        self._note_changes(card, texts)

    def insert(self, card: Card, new: NewCard) -> None:
        self._check_editable(card)
        layout = layout_of(card.lines[-1])
        if self.wide or any(isinstance(field, str) and len(field) > layout.width for field in new.fields):
            layout = _LARGE if layout.format != "free" or self.wide else layout
        width = 16 if layout.format == "free" and not layout.large else layout.width
        texts = [_new_field_text(field, layout, width) for field in new.fields]
        key = card.lines[-1][:2]
        above = self.replacements.get(key, card.lines[-1].text)
        added = new_card_lines(layout, new.name, texts)
        self.replacements[key] = _joined(above, added, self.endings[card.lines[-1].file])

    def _check_editable(self, card: Card) -> None:
        following = self.deck.cards[card.position + 1 : card.position + 2]
        if card.replicated or any(below.replicated for below in following):
            raise card.error("write.replicated")
        if self.uses[card.lines[0][:2]] > 1:
            raise card.error("write.included-twice")

    def _note_values(self, card: Card, values: Mapping[int, float | int | str]) -> None:
        for index, value in values.items():
            if not isinstance(value, str | Integral):
                self.values[card.position, index] = float(value)

    def _note_changes(self, card: Card, texts: dict[int, str]) -> None:
        for index, text in sorted(texts.items()):
            before = card.fields[index] if index < len(card.fields) else ""
            self.changes.append(FieldChange(card.position, index, card.where(index), before, text))
            if (card.position, index) in self.values:
                self.values[card.position, index] = _read_back(text)

    def _replace(self, card: Card, lines: list[list[str]]) -> None:
        ending = self.endings[card.lines[0].file]
        for old, (first, *more) in zip(card.lines, lines):
            text = _joined(first, more, ending)
            if text != old.text:
                self.replacements[old[:2]] = text


def _new_field_text(field: Value, layout: CardLayout, width: int) -> str:
    exact = isinstance(field, str | Integral) or field is None
    return value_text(field, width if exact else layout.width)


def _read_back(text: str) -> float:
    value = parse_number(text)
    assert value is not None
    return value


def _already(card: Card, index: int, value: float | int | str) -> bool:
    if isinstance(value, str | Integral):
        return card.text(index) == str(value).upper()
    return parse_number(card.text(index)) == float(value)


def _is_cut(card: Card, index: int, value: float | int | str) -> bool:
    exact = isinstance(value, str | Integral)
    return not exact and rounded(float(value), _width(card, index)) != float(value)


def _width(card: Card, index: int) -> int:
    row, slot = card.slot(index)
    if row < len(card.lines):
        return field_width(card.lines[row], slot)
    return layout_of(card.lines[-1]).width


def in_all_fields(card: Card, indices: Sequence[int], value: float) -> float:
    """The value held by each of several fields: rounded to the narrowest of them."""
    narrowest = min(_width(card, index) for index in indices)
    return rounded(value, narrowest) if len(indices) > 1 and math.isfinite(value) else value


def _texts(card: Card, values: Mapping[int, float | int | str], widen: bool) -> dict[int, str]:
    texts = {}
    for index, value in values.items():
        try:
            texts[index] = value_text(value, 16 if widen else _width(card, index))
        except FemtuneError as error:
            error.where = card.where(index)
            raise
    return texts


def _joined(above: str, added: Sequence[str], ending: str) -> str:
    """Lines inserted below `above`; the last one has the line ending of `above`."""
    if not added:
        return above
    content = above.rstrip("\r\n")
    last = above[len(content) :]
    return (last or ending).join([content, *added]) + last


def _edited(card: Card, texts: dict[int, str]) -> list[list[str]]:
    """New physical lines for each line of the card, fields replaced in place or added at its end."""
    lines = list(card.lines)
    beyond: dict[tuple[int, int], str] = {}
    for index, text in sorted(texts.items()):
        row, slot = card.slot(index)
        if row < len(lines):
            lines[row] = with_field(lines[row], slot, text)
        else:
            beyond[row, slot] = text
    return [*([line.text] for line in lines[:-1]), [lines[-1].text, *_added_lines(lines, beyond)]]


def _added_lines(lines: Sequence[SourceLine], beyond: Mapping[tuple[int, int], str]) -> list[str]:
    layout = layout_of(lines[-1])
    tail = split_line(lines[-1], lines[-1].body).tail
    name = tail[1:] if tail[:1] in ("+", "*") else ""
    added = []
    for row in range(len(lines), max((row for row, _ in beyond), default=-1) + 1):
        texts = [beyond.get((row, slot), "") for slot in range(layout.count)]
        head = ("*" if layout.large else "+") + (name if row == len(lines) else "")
        added.append(new_line(layout, head, texts))
    sizes = [split_line(line, line.body).size for line in lines] + [(layout.large, layout.count)] * len(added)
    halves = line_starts(sizes)
    if added and layout.large and halves[-1] % 8 == 0:
        added.append(new_line(layout, "*", ()))
    return added


def _widened(card: Card, texts: dict[int, str]) -> list[list[str]]:
    """The card with every line of eight fields turned into two lines of four."""
    fields = dict(enumerate(card.fields)) | texts
    cuts = [split_line(line, line.body) for line in card.lines]
    starts = line_starts([cut.size for cut in cuts])
    widened = []
    for line, cut, start in zip(card.lines, cuts, starts):
        if cut.large:
            widened.append([_with_fields(line, {i - start: text for i, text in texts.items()}).text])
        else:
            row = [_sixteen(fields.get(start + slot, "")) for slot in range(len(cut.data))]
            widened.append(_two_lines(line, cut.head, row, cut.tail))
    end = starts[-1] + len(cuts[-1].data)
    rest = [fields.get(i, "") for i in range(end, max(fields) + 1)]
    return [*widened[:-1], [*widened[-1], *_rest_lines(end, rest)]]


def _with_fields(line: SourceLine, texts: dict[int, str]) -> SourceLine:
    for slot in texts.keys() & range(4):
        line = with_field(line, slot, texts[slot])
    return line


def _rest_lines(start: int, rest: Sequence[str]) -> list[str]:
    """Lines in large field for the fields from index `start` on, up to a whole line of eight fields."""
    ends = range(start, start + len(rest) + (-start - len(rest)) % 8, 4) if rest else ()
    return [new_line(_LARGE, "*", rest[at - start : at - start + 4]) for at in ends]


def _two_lines(line: SourceLine, head: str, row: Sequence[str], tail: str) -> list[str]:
    comment = line.text.rstrip("\r\n").partition("$")[2]
    name = head + "*" if head[:1] not in ("+", "") else "*" + head[1:]
    first = new_line(_LARGE, name, row[:4])
    first = f"{first.ljust(80)}${comment}" if "$" in line.text else first
    second_tail = "*" + tail[1:] if tail[:1] == "+" and tail[1:] else ""
    more = [new_line(_LARGE, "*", row[at : at + 4]) for at in range(4, len(row) - 4, 4)]
    return [first + line.ending, *more, new_line(_LARGE, "*", row[-4:], second_tail)]


def _sixteen(text: str) -> str:
    value = parse_number(text)
    return format_real(value, 16) if len(text) > 16 and value is not None else text


def _check_read_back(card: Card, texts: dict[int, str], lines: Sequence[Sequence[str]]) -> None:
    """Read the new lines back: all fields must be as intended."""
    rows = [text for row in lines for text in row]
    read = read_bulk([SourceLine(card.lines[0].file, 1 + i, text) for i, text in enumerate(rows)]).cards
    wanted = {i: text for i, text in (dict(enumerate(card.fields)) | texts).items() if text}
    read_fields = {i: text for i, text in enumerate(read[0].fields) if text} if len(read) == 1 else {}
    if {i: _sixteen(text) for i, text in read_fields.items()} != {i: _sixteen(text) for i, text in wanted.items()}:
        raise card.error("write.not-read-back")
