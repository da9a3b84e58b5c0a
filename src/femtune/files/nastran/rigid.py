"""Rigid elements as equations: RBE1, RBE2, RBE3, RBAR, RBAR1, RTRPLT, RTRPLT1, RROD, RSPLINE, and CRIGD1, CRIGD2,
CRIGD3 and CRIGDR of NASTRAN-95."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from femtune.errors import FemtuneError, Notice
from femtune.fem.constraints import (
    ALL_COMPONENTS,
    WeightedPoints,
    average_rows,
    rigid_bar_rows,
    rigid_body_rows,
    rigid_element_rows,
    rigid_plate_rows,
    rigid_rod_rows,
)
from femtune.fem.splines import spline_rows
from femtune.fem.structure import ConstraintRows, join_constraints
from femtune.files.nastran.building import Building, listed_numbers
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.lists import read_list

# ----------------------------------------------------------------------------------------------------
# Rigid elements whose cards hold lists of any length: RBE1 and RBE3.


_WORDS = ("UM", "MSET", "ALPHA")
Pairs = list[tuple[int, list[int]]]


@dataclass
class _Fields:
    """The filled fields of a card in sequence, from a position; blank ones are skipped."""

    card: Card
    at: int

    def next(self) -> int | None:
        """Position of the next filled field, or None at the end."""
        while self.at < len(self.card.fields) and self.card.blank(self.at):
            self.at += 1
        return self.at if self.at < len(self.card.fields) else None

    def take(self) -> int:
        """Position of the next field, which must exist."""
        at = self.next()
        if at is None:
            return self.at
        self.at = at + 1
        return at

    def until_real(self) -> list[str]:
        """Texts up to the next real number or word, exclusive."""
        texts = []
        while (at := self.next()) is not None and not self.card.is_real(at) and self.card.text(at) not in _WORDS:
            texts.append(self.card.text(self.take()))
        return texts


def body_rows(record: CardEntry, grids: Grids) -> ConstraintRows:
    """RBE1 and CRIGD3: independent components GNi, CNi; dependent ones after UM (MSET of CRIGD3)."""
    fields = _Fields(record.card, 1)
    independent = _pairs(fields)
    dependent = _after_words(fields).get("UM", [])
    if not dependent:
        raise record.error("deck.field-value/rbe1-dependents")
    _check_points(record, grids, [n for n, _ in (*independent, *dependent)])
    return rigid_body_rows(grids.table, independent, dependent, record.integer("EID"))


def averaging_rows(record: CardEntry, grids: Grids) -> ConstraintRows:
    """RBE3: groups WT, C, G; other dependent components after UM; ALPHA has no meaning without temperatures."""
    fields = _Fields(record.card, 4)
    groups = [_group(record, fields)]
    while (at := fields.next()) is not None and record.card.text(at) not in _WORDS:
        groups.append(_group(record, fields))
    dependent = _after_words(fields).get("UM", [])
    reference, components = record.integer("REFGRID"), _digits(record.card, 3)
    _check_points(record, grids, [reference, *(n for g in groups for n in g.numbers), *(n for n, _ in dependent)])
    return average_rows(grids.table, reference, components, groups, record.integer("EID"), dependent)


def _group(record: CardEntry, fields: _Fields) -> WeightedPoints:
    at = fields.take()
    if record.card.is_integer(at):
        # a weight without decimal point cannot be told from the number of a grid point
        raise record.card.error("deck.not-a-real", index=at)
    weight = record.card.real(at)
    components = _digits(record.card, fields.at)
    fields.at += 1
    at = fields.at
    numbers = _list_numbers(record, fields.until_real())
    if not numbers:
        raise record.card.error("deck.field-value/weight-without-points", index=at)
    return WeightedPoints(weight, components, numbers)


def _list_numbers(record: CardEntry, texts: list[str]) -> list[int]:
    """A list with THRU written out; a repeated number is kept."""
    named = Counter(read_list(texts, record.where).singles)
    return listed_numbers(record, texts) + [n for n, times in named.items() if times > 1]


def _after_words(fields: _Fields) -> dict[str, Pairs]:
    """The pairs after UM; the values after ALPHA must be numbers."""
    pairs: dict[str, Pairs] = {}
    while (at := fields.next()) is not None:
        word = fields.card.text(fields.take())
        if word in ("UM", "MSET"):
            pairs.setdefault("UM", []).extend(_pairs(fields))
        elif word == "ALPHA" or fields.card.is_real(at):
            fields.card.real(fields.take() if word == "ALPHA" else at)
        else:
            raise fields.card.error("deck.field-value/rbe3-word", index=at)
    return pairs


def _pairs(fields: _Fields) -> Pairs:
    """Grid points, each with its components, up to a word or a real number."""
    pairs: Pairs = []
    card = fields.card
    while (at := fields.next()) is not None and card.text(at) not in _WORDS and not card.is_real(at):
        number = card.integer(fields.take())
        pairs.append((number, _digits(card, fields.at)))
        fields.at += 1
    return pairs


def _digits(card: Card, at: int) -> list[int]:
    """Components of a grid point, which are required (error ``deck.field-value``)."""
    text = card.component(at)
    if text in ("", "0"):
        raise card.error("deck.field-value/no-components", index=at)
    return [int(c) for c in text]


def _check_points(record: CardEntry, grids: Grids, numbers: list[int]) -> None:
    for number in numbers:
        grids.row(number, record)


def read_rigid(building: Building, grids: Grids) -> ConstraintRows:
    """Equations of all rigid elements."""
    parts = []
    for record in building.records(*_READERS):
        with building.errors.catch():
            parts.append(_placed(record, grids))
    _note_expansion(building)
    return join_constraints(parts)


def _placed(record: CardEntry, grids: Grids) -> ConstraintRows:
    """Rows of an element; errors of the kernel get the place of the card."""
    try:
        return _READERS[record.name](record, grids)
    except FemtuneError as error:
        if error.where is None or error.where.file:
            raise
        raise error.at(record.where) from error


def _note_expansion(building: Building) -> None:
    """Notice of thermal expansion, the only real number on a rigid element except for the weights of RBE3."""
    expanding = [record for record in building.records(*_READERS) if _expands(record)]
    if expanding:
        count = f"{len(expanding)} rigid element{'s give' if len(expanding) > 1 else ' gives'}"
        building.notices.append(Notice("deck.rigid-expansion", where=expanding[0].where, level="info", count=count))


def _expands(record: CardEntry) -> bool:
    if record.name == "RBE3":
        return "ALPHA" in map(str.upper, record.card.fields)
    if record.name == "RSPLINE":
        return False
    return any(record.card.is_real(at) for at in range(len(record.card.fields)))


def _spider(record: CardEntry, grids: Grids) -> ConstraintRows:
    components = _numbers(record.component("CM"))
    if not components or components == [0]:
        raise record.error("deck.field-value/rbe2-components", at="CM")
    numbers = _dependents(record)
    for number in (record.integer("GN"), *numbers):
        grids.row(number, record)
    return rigid_element_rows(grids.table, record.integer("GN"), numbers, components, record.integer("EID"))


def _dependents(record: CardEntry, first: int = 3) -> list[int]:
    """Grid points from field `first` on; a real number at the end is the thermal expansion coefficient."""
    fields = list(record.card.fields[first:])
    while fields and (not fields[-1].strip() or record.card.is_real(first - 1 + len(fields))):
        fields.pop()
    numbers = listed_numbers(record, fields)
    if not numbers:
        raise record.error("deck.field-value/rbe2-dependents")
    return numbers


def _old_spider(record: CardEntry, grids: Grids) -> ConstraintRows:
    """CRIGD1: all components of G1, G2 …; CRIGD2: components C1 of G1, C2 of G2 …; both follow those of IG."""
    if record.name == "CRIGD1":
        dependent = [(n, list(ALL_COMPONENTS)) for n in _dependents(record, 2)]
    else:
        dependent = _pairs(_Fields(record.card, 2))
    if not dependent:
        raise record.error("deck.field-value/rbe2-dependents")
    first = record.integer("IG")
    _check_points(record, grids, [first, *(n for n, _ in dependent)])
    return rigid_body_rows(grids.table, [(first, list(ALL_COMPONENTS))], dependent, record.integer("EID"))


def _bar(record: CardEntry, grids: Grids) -> ConstraintRows:
    a, b = _points(record, grids, "GA", "GB")
    free = (_of(record, "CNA"), _of(record, "CNB"))
    if not any(free):
        free = (list(ALL_COMPONENTS), [])
    follow = (_of(record, "CMA"), _of(record, "CMB"))
    return rigid_bar_rows(grids.table, (a, b), free, follow, record.integer("EID"))


def _first_rules(record: CardEntry, grids: Grids) -> ConstraintRows:
    """RBAR1 and RTRPLT1: end A moves the others, in all components if none are given."""
    names = {"GB": "CB"} if record.name == "RBAR1" else {"GB": "CMB", "GC": "CMC"}
    points = _points(record, grids, "GA", *names)
    dependent = [(n, _of(record, c) or list(ALL_COMPONENTS)) for n, c in zip(points[1:], names.values())]
    free = [(points[0], ALL_COMPONENTS)]
    return rigid_plate_rows(grids.table, points, free, dependent, record.integer("EID"), record.name)


def _plate(record: CardEntry, grids: Grids) -> ConstraintRows:
    points = _points(record, grids, "GA", "GB", "GC")
    free, follow = ([(n, _of(record, kind + end)) for n, end in zip(points, "ABC")] for kind in ("CN", "CM"))
    return rigid_plate_rows(grids.table, points, free, follow, record.integer("EID"), record.name)


def _rod(record: CardEntry, grids: Grids) -> ConstraintRows:
    a, b = _points(record, grids, "GA", "GB")
    # the dependent component of CRIGDR is one of its second point
    names = ((1, "CMB"),) if record.name == "CRIGDR" else ((0, "CMA"), (1, "CMB"))
    chosen = [(end, c) for end, name in names for c in _of(record, name)]
    if len(chosen) != 1 or chosen[0][1] > 3:
        raise record.error("deck.field-value/rrod-component", at=names[0][1])
    return rigid_rod_rows(grids.table, (a, b), chosen[0], record.integer("EID"))


_TUBE_RATIO = 0.1
"""Default of D/L of an RSPLINE, as in Nastran."""
_THINNEST_TUBE = 1e-6
_THICKEST_TUBE = 1e3
"""Limits of D/L of an RSPLINE; beyond them bending is lost in the rounding of extension, or the reverse."""


def _spline(record: CardEntry, grids: Grids) -> ConstraintRows:
    """RSPLINE: G1, then pairs of grid point and dependent components; blank for independent points."""
    card = record.card
    points: list[int] = [record.integer("G1")]
    dependent: list[list[int]] = [[]]
    for at in range(3, max(len(card.fields), 4), 2):
        if not card.blank(at):
            points.append(card.integer(at))
            dependent.append([c for c in _numbers(card.component(at + 1)) if c])
        elif not card.blank(at + 1):
            raise card.error("deck.field-value/spline-point", index=at)
    ratio = card.real(1, _TUBE_RATIO)
    if not _THINNEST_TUBE <= ratio <= _THICKEST_TUBE:
        raise card.error("deck.field-value/spline-ratio", index=1)
    if len(points) < 3 or dependent[-1] or not any(dependent):
        raise record.error("deck.field-value/spline")
    for number in points:
        grids.row(number, record)
    return spline_rows(grids.table, points, dependent, ratio, record.integer("EID"))


def _points(record: CardEntry, grids: Grids, *names: str) -> list[int]:
    numbers = [record.integer(name) for name in names]
    for number in numbers:
        grids.row(number, record)
    return numbers


def _of(record: CardEntry, name: str) -> list[int]:
    return [c for c in _numbers(record.component(name)) if c]


def _numbers(digits: Iterable[str]) -> list[int]:
    return [int(d) for d in digits]


_READERS: dict[str, Callable[[CardEntry, Grids], ConstraintRows]] = {
    "RBE2": _spider,
    "RBAR": _bar,
    "RBAR1": _first_rules,
    "RBE1": body_rows,
    "RBE3": averaging_rows,
    "RROD": _rod,
    "RTRPLT": _plate,
    "RTRPLT1": _first_rules,
    "RSPLINE": _spline,
    "CRIGD1": _old_spider,
    "CRIGD2": _old_spider,
    "CRIGD3": body_rows,
    "CRIGDR": _rod,
}
