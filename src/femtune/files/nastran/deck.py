"""A Nastran deck: executive control, case control and the cards of the bulk data, every line kept."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.assembly import read_bulk
from femtune.files.nastran.card import Card
from femtune.files.nastran.case_control import CaseControl, read_case_control
from femtune.files.nastran.lines import parse_integer
from femtune.files.nastran.recognition import foreign_line
from femtune.files.nastran.source import DeckSource, SourceFile, SourceLine, read_source

_BEGIN = re.compile(r"\s*BEGIN\b[\s,]*(BULK\b|SUPER\b|$)", re.IGNORECASE)
_CEND = re.compile(r"\s*CEND\s*", re.IGNORECASE)
_EXECUTIVE = re.compile(r"\s*(SOL|ID|TIME|DIAG|GEOMCHECK|NASTRAN|INIT|ASSIGN|APP|CEND)(?=[\s,]|$)", re.IGNORECASE)
_CARD = re.compile(r" {0,7}[A-Z][A-Z0-9]{1,7}\*?[ ,\t]+[^\s]", re.IGNORECASE)
_SOL = re.compile(r"\s*SOL[\s,=]+(\w+)", re.IGNORECASE)
_SOLUTION_NUMBERS = {"SEMODES": 103, "MODES": 103, "SESTATIC": 101, "SESTATICS": 101, "SEMFREQ": 111, "SEBUCKL": 105,
    "SEDCEIG": 107, "SEMCEIG": 110, "NLSTATIC": 106, "NONLIN": 400}  # fmt: skip
BUCKLING = (5, 16, 65, 77, 105)
"""Numbers of the solution sequences for buckling, whose METHOD does not select natural modes; below 101 old formats."""


@dataclass(frozen=True)
class Executive:
    """Executive control (with file management): its statements as written and the name of the solution."""

    lines: tuple[SourceLine, ...] = ()
    solution: str = ""

    @property
    def solution_number(self) -> int | None:
        """Number of the solution sequence (103 for SEMODES), None if it is unknown."""
        return _SOLUTION_NUMBERS.get(self.solution, parse_integer(self.solution))


@dataclass(frozen=True)
class DeckParameter:
    """Raw value of a PARAM and the card that gives it."""

    value: str
    card: Card


@dataclass(frozen=True)
class Deck:
    """One deck as read.

    `files` are all files, the main one first; `cards` are in the order of reading with INCLUDEs expanded in place;
    `params` has the effective value of each PARAM (the last one; case control before bulk data); `parts` are the BEGIN
    SUPER lines by the number of their superelement, `aside` those of sections that are not part of the model. `section`
    is the number of the part that `names` is limited to, 0 for the main bulk data, None for all; `by_section` are the
    cards by part, which the decks of all parts share.
    """

    path: Path
    source: DeckSource
    executive: Executive
    case_control: CaseControl
    cards: tuple[Card, ...]
    params: Mapping[str, DeckParameter]
    notices: tuple[Notice, ...]
    parts: Mapping[int, SourceLine] = field(default_factory=dict)
    aside: tuple[SourceLine, ...] = ()
    section: int | None = None
    by_section: Mapping[int, Mapping[str, tuple[Card, ...]]] | None = field(default=None, repr=False, compare=False)

    def of_section(self, number: int) -> Deck:
        """The deck limited to one part, 0 for the main bulk data, with the PARAMs and selections of that part."""
        params, _ = _params(self.case_control, list(self.sections.get(number, {}).get("PARAM", ())))
        case = self.case_control.of_superelement(number) if number else self.case_control
        return replace(self, section=number, params=params, case_control=case, by_section=self.sections)

    @cached_property
    def sections(self) -> Mapping[int, Mapping[str, tuple[Card, ...]]]:
        """Cards by part and name; those of all parts are sorted once."""
        if self.by_section is not None:
            return self.by_section
        sorted_cards: dict[int, dict[str, list[Card]]] = {}
        for card in self.cards:
            sorted_cards.setdefault(card.superelement, {}).setdefault(card.name, []).append(card)
        return {n: {name: tuple(cards) for name, cards in own.items()} for n, own in sorted_cards.items()}

    @cached_property
    def _numbered(self) -> dict[str, dict[int, Card]]:
        return {}

    def numbered(self, name: str) -> Mapping[int, Card]:
        """The first card of each number, of the cards of one name."""
        if name not in self._numbered:
            first: dict[int, Card] = {}
            for card in self.by_name(name):
                first.setdefault(card.integer(0, 0), card)
            self._numbered[name] = first
        return self._numbered[name]

    @property
    def files(self) -> tuple[SourceFile, ...]:
        """All files of the deck, the main file first."""
        return self.source.files

    @cached_property
    def names(self) -> Mapping[str, tuple[Card, ...]]:
        """Cards by name, names in the order in which they occur."""
        if self.section is not None:
            return self.sections.get(self.section, {})
        by_name: dict[str, list[Card]] = {}
        for card in self.cards:
            if card.superelement >= 0:
                by_name.setdefault(card.name, []).append(card)
        return {name: tuple(cards) for name, cards in by_name.items()}

    def by_name(self, name: str) -> tuple[Card, ...]:
        """All cards of one name in the order of the deck."""
        return self.names.get(name.upper(), ())


def read_deck(path: str | Path) -> Deck:
    """Read a deck with its INCLUDEs; a file may also contain bulk data alone.

    Raises
    ------
    FemtuneError : see `read_source`, `read_bulk`, `read_case_control`; ``deck.truncated`` if the deck ends
        before BEGIN BULK, ``deck.other-program`` for the input of another program
    """
    source = read_source(path)
    _check_no_test(source)
    _check_program(source)
    lines, case, bulk_lines = _sections(source)
    executive = _executive(lines)
    case_control = read_case_control(case, executive.solution_number not in BUCKLING)
    bulk = read_bulk(bulk_lines)
    # those of a part apply to that part
    params, repeated = _params(case_control, [c for c in bulk.cards if c.name == "PARAM" and not c.superelement])
    has_sections = bool(bulk_lines) and _BEGIN.match(bulk_lines[0].text) is not None
    end = _check_end(source, has_sections)
    notices = (*source.notices, *case_control.notices, *bulk.notices, *repeated, *end)
    return Deck(
        path=Path(path),
        source=source,
        executive=executive,
        case_control=case_control,
        cards=bulk.cards,
        params=params,
        notices=notices,
        parts=bulk.parts,
        aside=bulk.aside,
    )


def _unread(source: DeckSource) -> Iterator[Notice]:
    """Notice of cards after ENDDATA; a warning if ENDDATA is in an included file, where it is often left by mistake."""
    cards = [line for line in source.unread if _CARD.match(line.text)]
    if cards:
        end, first = source.lines[-1], cards[0]
        level = "warning" if end.file != source.files[0].file else "info"
        several = len(cards) > 1
        yield Notice(
            "deck.after-enddata", where=Where(first.file, first.number, _name(first)), level=level, count=len(cards),
            plural="s" if several else "", verb="are" if several else "is", end=Path(end.file).name, line=end.number,
        )  # fmt: skip


def _name(line: SourceLine) -> str:
    return re.split(r"[\s,*]", line.text.strip(), maxsplit=1)[0].upper()


_Lines = tuple[SourceLine, ...]


def _check_no_test(source: DeckSource) -> None:
    """A Universal File is a test (error ``deck.universal-file``)."""
    first = next((line for line in source.lines if line.text.strip()), None)
    if first is not None and first.text.strip() == "-1":
        raise FemtuneError("deck.universal-file", where=Where(first.file, first.number))


def _check_program(source: DeckSource) -> None:
    """Inputs of Abaqus, CalculiX and Ansys are no bulk data (error ``deck.other-program``)."""
    line = foreign_line(line for line in source.lines if line.body.strip())
    if line is not None:
        where = Where(line.file, line.number, line.body.strip()[:40])
        raise FemtuneError("deck.other-program", where=where)


def _sections(source: DeckSource) -> tuple[_Lines, _Lines, _Lines]:
    """Lines of executive control, case control and bulk data."""
    lines = source.lines[:-1] if source.ended else source.lines
    begin = next((i for i, line in enumerate(lines) if _BEGIN.match(line.text)), None)
    if begin is None:
        _check_bulk_only(lines)
        return (), (), lines
    cend = next((i for i, line in enumerate(lines[:begin]) if _CEND.fullmatch(line.body)), None)
    bulk = lines[begin:]
    if cend is not None:
        return lines[:cend], lines[cend + 1 : begin], bulk
    if "SUPER" in lines[begin].text.upper() and not any(_EXECUTIVE.match(line.text) for line in lines[:begin]):
        # bulk data alone, with parts
        return (), (), lines
    executive = tuple(line for line in lines[:begin] if _EXECUTIVE.match(line.text))
    return executive, tuple(line for line in lines[:begin] if not _EXECUTIVE.match(line.text)), bulk


def _check_bulk_only(lines: _Lines) -> None:
    statement = next((line for line in lines if _EXECUTIVE.match(line.text)), None)
    if statement:
        raise FemtuneError(
            "deck.truncated/no-bulk-data", where=Where(statement.file, statement.number, statement.body.strip()[:20])
        )


def _executive(lines: _Lines) -> Executive:
    solutions = [match[1].upper() for line in lines if (match := _SOL.match(line.body))]
    return Executive(lines, solutions[0] if solutions else "")


def _params(case_control: CaseControl, in_bulk: list[Card]) -> tuple[dict[str, DeckParameter], list[Notice]]:
    in_case = read_bulk(case_control.parameter_lines).cards
    params: dict[str, DeckParameter] = {}
    notices = []
    for card in [*in_bulk, *in_case]:
        name, value = card.text(0), card.text(1)
        if name in params and params[name].value != value:
            notices.append(
                Notice(
                    "deck.repeated-param",
                    where=card.where(),
                    name=name,
                    used_value=value,
                    unused_value=params[name].value,
                )
            )
        params[name] = DeckParameter(value, card)
    return params, notices


def _check_end(source: DeckSource, has_sections: bool) -> tuple[Notice, ...]:
    if source.ended:
        return tuple(_unread(source))
    if not has_sections:
        return ()
    main = source.files[0]
    last = main.lines[-1]
    where = Where(main.file, last.number)
    if not last.ending:
        return (Notice("deck.no-enddata/middle-of-line", where=where, text=last.body.strip()[-40:]),)
    return (Notice("deck.no-enddata", where=where),)
