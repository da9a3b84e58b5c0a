"""Superelements: the parts of a deck, their boundaries, their reduced matrices, and unsupported cards."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError, Notice, Where
from femtune.fem.assembled import AssembledMatrix
from femtune.fem.fields import MatrixKind
from femtune.fem.joined import Increase, Point
from femtune.fem.structure import Structure
from femtune.files.matrices.op4 import op4_names, read_op4
from femtune.files.matrices.read_matrix import ReadMatrix
from femtune.files.nastran.building import Building, listed_numbers
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.coordinates import BASIC, CoordinateSystem, system_through
from femtune.files.nastran.deck import Deck
from femtune.files.nastran.grids import Grids, read_grids
from femtune.files.nastran.lines import parse_number
from femtune.files.nastran.lists import IntegerList, read_list
from femtune.files.nastran.matrices import dmig_names, dmig_upper, scaled_matrix

_IN_ONE_MODEL = ("SESET", "SETREE", "SEELT", "SEQSET", "SEQSET1")
# cards that move or copy a part, or change its boundary
_REFUSED = ("SEMPLN", "RELEASE", "CSUPER", "CSUPEXT")
# TYPE of SEBULK: a part with bulk data, and parts with matrices in an OP4 file or on DMIG cards
_PRIMARY = "PRIMARY"
_OP4 = ("EXTOP4", "MATOP4")
_DMIG = "EXTERNAL"
_LOCATION_TOLERANCE = 1e-5
"""Default of TOL on SEBULK and SECONCT: distance of boundary points, in the deck's unit of length, as in Nastran."""
_TRIANGLE_ERROR = 1e-3
"""Largest difference of the sides of SELOC's two triangles, relative to the first side.

Above the rounding of coordinates; points that do not correspond differ by more.
"""
_OTHER_UNITS = 1e4
"""Ratio of the largest densities of two parts beyond which their units differ; foam and steel differ by 300."""
_NEAR_MISS = 0.05
"""Distance of two points, relative to that of each to its nearest neighbour in its part, up to which they belong
together.

Larger than errors of rounded or converted coordinates, and far below the size of an element.
"""
_SAME_PLACE = 1e-6
"""Distance, relative to the size of a part, up to which two of its points are in one place."""
_FEW = 8
"""Neighbours among which that in another place is looked for: few points of a part coincide."""
_SEARCHES = ("AUTO", "MANUAL")
_ASSIGN = re.compile(r"ASSIGN\s+INPUTT4\s*=\s*(?:'([^']*)'|\"([^\"]*)\"|([^\s,'\"]+))(.*)", re.IGNORECASE | re.DOTALL)
_UNIT = re.compile(r"\bUNIT\s*=?\s*(\d{1,5})", re.IGNORECASE)
# names under which EXTSEOUT writes the matrices of the boundary
_NAMES: tuple[tuple[MatrixKind, tuple[str, ...]], ...] = (
    ("stiffness", ("KXX", "KAA", "KAAX")),
    ("mass", ("MXX", "MAA", "MAAX")),
    ("viscous", ("BXX1", "BXX", "BAA", "BAAX")),
    ("hysteretic", ("K4XX1", "K4XX", "K4AA", "K4AAX")),
)
_NEEDED = ("stiffness", "mass")


def superelement_notices(deck: Deck) -> list[Notice]:
    """Notices for a deck with superelements; parts are solved as a whole, without Nastran's reduction.

    Raises
    ------
    FemtuneError : ``deck.superelement`` for unsupported cards
    """
    _refuse(deck)
    aside = [*_absent_parts(deck), *_other_units(deck)]
    aside += [
        Notice("deck.other-section", where=Where(line.file, line.number), section=line.body.strip())
        for line in deck.aside
    ]
    return aside + _of_division(deck)


def _absent_parts(deck: Deck) -> Iterator[Notice]:
    """Notice of superelements that case control selects and the deck does not have."""
    there = {0, *deck.parts, *_in_grids(deck)}
    for numbers, case in deck.case_control.of_superelements:
        absent = [n for n in numbers.singles if n not in there]
        if absent and len(there) > 1:
            command = next((c for c in case.effective if c.name == "SUPER"), None)
            where = Where(str(deck.path), record="SUPER") if command is None else command.where
            yield Notice(
                "deck.superelement/absent", where=where, number=absent[0],
                parts=", ".join(map(str, sorted(there - {0})[:10])),
            )  # fmt: skip


def _in_grids(deck: Deck) -> set[int]:
    """Superelements that fields of GRID and lists of SESET divide one model into."""
    of_grids = (
        {card.integer(7) for card in deck.by_name("GRID") if card.is_integer(7)}
        if deck.case_control.of_superelements
        else set()
    )
    return of_grids | {card.integer(0) for card in deck.by_name("SESET") if card.is_integer(0)}


def _other_units(deck: Deck) -> Iterator[Notice]:
    """Notice of a part whose densities are those of another system of units."""
    largest = {n: _largest_density(cards) for n, cards in deck.sections.items() if n >= 0}
    known = {n: value for n, value in largest.items() if value > 0.0}
    if len(known) < 2:
        return
    main = known.get(0, float(np.median(list(known.values()))))
    for number, value in known.items():
        if number in deck.parts and max(value / main, main / value) > _OTHER_UNITS:
            line = deck.parts[number]
            where = Where(line.file, line.number, f"BEGIN SUPER {number}")
            yield Notice(
                "deck.superelement/units", where=where, number=number, density=f"{value:.3g}", other=f"{main:.3g}"
            )


def _largest_density(cards: Mapping[str, tuple[Card, ...]]) -> float:
    given = (parse_number(card.text(4)) for card in cards.get("MAT1", ()))
    return max((abs(value) for value in given if value is not None), default=0.0)


def _of_division(deck: Deck) -> list[Notice]:
    if deck.parts:
        names = ", ".join(map(str, list(deck.parts)[:10])) + (" …" if len(deck.parts) > 10 else "")
        number, line = next(iter(deck.parts.items()))
        where = Where(line.file, line.number, f"BEGIN SUPER {number}")
        return [_whole_parts(deck, where, names)]
    card = next((deck.by_name(name)[0] for name in _IN_ONE_MODEL if deck.by_name(name)), None)
    if card is not None:
        return [Notice("deck.superelement/whole", where=card.where(), by=card.name)]
    command = next(
        (c for c in deck.case_control.others if c.name == "SUPER" and c.value.upper() not in ("0", "")), None
    )
    if command is None:
        return []
    divided = next((c for c in deck.by_name("GRID") if not c.blank(7) and c.text(7) != "0"), None)
    return [] if divided is None else [Notice("deck.superelement/whole", where=command.where, by="SEID of GRID")]


def increase_notice(deck: Deck, number: int, more: Increase) -> Notice:
    """Notice of the increase of a superelement's numbers that also occur in other parts."""
    line = deck.parts[number]
    groups = ("points", more.points), ("elements", more.elements), ("properties and materials", more.cards)
    named = ", ".join(name for name, by in groups if by)
    by = max(by for _, by in groups)
    where = Where(line.file, line.number, f"BEGIN SUPER {number}")
    return Notice("deck.superelement/numbers", where=where, level="info", number=number, groups=named, increase=by)


def _whole_parts(deck: Deck, where: Where, names: str) -> Notice:
    """Notice that Nastran reduces a part without component modes statically, with much different frequencies."""
    dynamic = {card.superelement for card in deck.cards if card.name in ("QSET", "QSET1", "SENQSET")}
    listed = {int(card.integer(0, 0)) for card in deck.by_name("SENQSET")} if deck.by_name("SENQSET") else set()
    static = [n for n in deck.parts if n not in dynamic | listed and not _is_external(deck, n)]
    if static:
        numbers = ", ".join(map(str, static[:10]))
        return Notice("deck.superelement/static", where=where, parts=names, static=numbers)
    return Notice("deck.superelement/parts", where=where, level="info", parts=names)


def _refuse(deck: Deck) -> None:
    card = next((deck.by_name(name)[0] for name in _REFUSED if deck.by_name(name)), None)
    if card is not None:
        raise FemtuneError("deck.superelement", where=card.where(), card=card.record)
    if deck.aside and any(c.name == "MASSSET" for c in deck.case_control.effective):
        line = deck.aside[0]
        raise FemtuneError(
            "deck.superelement/mass-increment", where=Where(line.file, line.number), section=line.body.strip()
        )
    for card in deck.by_name("SEBULK"):
        kind = card.text(1, _PRIMARY)
        if kind not in (_PRIMARY, *_OP4, _DMIG):
            raise FemtuneError("deck.superelement/type", where=card.where(1), card=card.record, kind=kind)
        if card.text(3, "AUTO") not in _SEARCHES:
            raise card.error("deck.field-value/superelement-search", index=3)
        if card.integer(0) not in deck.parts:
            raise FemtuneError("deck.superelement/no-part", where=card.where(), card=card.record, kind=kind)
    joined = next((c for name in ("SECONCT", "SEBNDRY", "SEEXCLD") for c in deck.by_name(name)), None)
    joined = next((c for c in deck.by_name("SELOC") if c.integer(0) not in deck.parts), joined)
    if joined is not None and (not deck.parts or joined.name == "SELOC"):
        raise FemtuneError("deck.superelement/no-part", where=joined.where(), card=joined.record, kind=_PRIMARY)
    if deck.parts and deck.case_control.preload is not None:
        number, line = next(iter(deck.parts.items()))
        raise FemtuneError("deck.superelement/preload", where=Where(line.file, line.number, f"BEGIN SUPER {number}"))


def _bulk_card(deck: Deck, number: int) -> Card | None:
    """SEBULK card of a superelement."""
    return deck.numbered("SEBULK").get(number)


def _is_external(deck: Deck, number: int) -> bool:
    card = _bulk_card(deck, number)
    return card is not None and card.text(1, _PRIMARY) != _PRIMARY


# ----------------------------------------------------------------------------------------------------
# Parts that are moved by SELOC, with a different basic system.


def moved_basic(deck: Deck, number: int) -> CoordinateSystem:
    """The basic system of a part in that of the whole.

    Raises
    ------
    FemtuneError : ``deck.superelement`` if the three points of SELOC do not match those of the main bulk data
    """
    card = deck.numbered("SELOC").get(number)
    if card is None:
        return BASIC
    part, main = (_Located(Building(deck.of_section(n))) for n in (number, 0))
    record = CardEntry(card, CATALOGUE["SELOC"].fields)
    in_part = [part.location(record.integer(f"PA{i}"), record) for i in (1, 2, 3)]
    other = [main.location(record.integer(f"PB{i}"), record) for i in (1, 2, 3)]
    one, two = system_through(0, "R", *in_part), system_through(0, "R", *other)
    gaps = [
        abs(np.linalg.norm(in_part[i] - in_part[j]) - np.linalg.norm(other[i] - other[j]))
        for i, j in ((0, 1), (0, 2), (1, 2))
    ]
    if one is None or two is None or max(gaps) > _TRIANGLE_ERROR * np.linalg.norm(in_part[1] - in_part[0]):
        raise FemtuneError("deck.superelement/location", where=card.where(), card=card.record)
    turn = two.axes @ one.axes.T
    return CoordinateSystem(0, "R", other[0] - turn @ in_part[0], turn)


class _Located:
    """Locations of GRID and POINT cards of a section."""

    def __init__(self, building: Building) -> None:
        self.grids = read_grids(building)
        self.points = {record.integer("ID"): record for record in building.records("POINT")}

    def location(self, number: int, user: CardEntry) -> Reals:
        record = self.points.get(number)
        if record is None:
            return self.grids.location(number, user)
        return self.grids.systems.get(record.integer("CP", 0), record).point(np.array(record.reals("X1", "X2", "X3")))


# ----------------------------------------------------------------------------------------------------
# Boundaries of parts: pairs on SECONCT cards, and coincident points unless SEBULK excludes the search.


@dataclass(frozen=True)
class BulkSection:
    """Structure of a part, or of the residual structure (number 0), with its numbers."""

    number: int
    structure: Structure


def boundary_pairs(deck: Deck, sections: Sequence[BulkSection], notices: list[Notice]) -> list[tuple[Point, Point]]:
    """Pairs of joined points, each given by the index of its section and its number.

    `notices` receives what is doubtful: points that are joined although they are far apart, and points that just miss
    each other.

    Raises
    ------
    FemtuneError : ``deck.superelement`` for points that do not exist, do not coincide, or are ambiguous
    """
    at = {section.number: i for i, section in enumerate(sections)}
    meshes = [_Mesh(section.structure.nodes.xyz) for section in sections]
    pairs: list[tuple[Point, Point]] = []
    for card in deck.by_name("SECONCT"):
        listed = list(_listed_pairs(card, at, sections))
        notices += _far_pairs(sections, meshes, listed, card.where(), card.record)
        pairs += listed
    for i, j in _neighbours(deck, sections, meshes):
        matched = list(joined_pairs(deck, sections, meshes, i, j))
        notices += _far_pairs(sections, meshes, matched, _where(deck, sections, i, j), "the search of boundary points")
        notices += _near_misses(deck, sections, meshes, (i, j), {*pairs, *matched})
        pairs += matched
    joined = {i for pair in pairs for i, _ in pair}
    for i, section in enumerate(sections):
        if section.number and i not in joined:
            line = deck.parts[section.number]
            where = Where(line.file, line.number, f"BEGIN SUPER {section.number}")
            raise FemtuneError("deck.superelement/not-joined", where=where, number=section.number)
    return pairs


@dataclass(frozen=True, eq=False)
class _Mesh:
    """The grid points of a section (n, 3) as a tree, and the distance of each to its nearest neighbour there."""

    xyz: Reals

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.xyz)

    @cached_property
    def spacing(self) -> Reals:
        """Distance of each point to the nearest one in another place; infinite if the nearest few are in one place."""
        if len(self.xyz) < 2:
            return np.full(len(self.xyz), np.inf)
        gaps = self.tree.query(self.xyz, k=min(_FEW, len(self.xyz)))[0]
        same_place = gaps <= _SAME_PLACE * np.ptp(self.xyz, axis=0).max()
        return np.asarray(np.where(same_place, np.inf, gaps).min(axis=1))

    @property
    def reach(self) -> float:
        """Distance up to which a point of another section just misses one of this."""
        finite = self.spacing[np.isfinite(self.spacing)]
        return _NEAR_MISS * float(finite.max(initial=0.0))


def _neighbours(deck: Deck, sections: Sequence[BulkSection], meshes: Sequence[_Mesh]) -> Iterator[tuple[int, int]]:
    """Pairs of sections whose boxes touch; the others have no boundary in common."""
    with_points = [i for i, mesh in enumerate(meshes) if len(mesh.xyz)]
    if not with_points:
        return
    margin = np.array([max(meshes[i].reach, _tolerance(deck, sections[i].number)) for i in with_points])
    low = np.array([meshes[i].xyz.min(axis=0) for i in with_points]) - margin[:, None]
    high = np.array([meshes[i].xyz.max(axis=0) for i in with_points]) + margin[:, None]
    for k, i in enumerate(with_points):
        touching = (low[k + 1 :] <= high[k]).all(axis=1) & (high[k + 1 :] >= low[k]).all(axis=1)
        yield from ((i, with_points[k + 1 + int(m)]) for m in np.flatnonzero(touching))


def _tolerance(deck: Deck, number: int) -> float:
    card = _bulk_card(deck, number)
    return _LOCATION_TOLERANCE if card is None else max(card.real(4, _LOCATION_TOLERANCE), 0.0)


def _far_pairs(
    sections: Sequence[BulkSection],
    meshes: Sequence[_Mesh],
    pairs: Sequence[tuple[Point, Point]],
    where: Where,
    by: str,
) -> Iterator[Notice]:
    """Notice of joined points that are far apart, measured by the spacing of the mesh."""
    far: list[tuple[float, int, int]] = []
    for (i, a), (j, b) in pairs:
        one, other = sections[i].structure.nodes, sections[j].structure.nodes
        if one.has_grid(a) and other.has_grid(b):
            rows = one.position(a), other.position(b)
            gap = float(np.linalg.norm(one.xyz[rows[0]] - other.xyz[rows[1]]))
            if gap > _NEAR_MISS * min(meshes[i].spacing[rows[0]], meshes[j].spacing[rows[1]]):
                far.append((gap, a, b))
    if far:
        gap, a, b = max(far)
        yield Notice(
            "deck.superelement/far", where=where, by=by, one=a, other=b, distance=f"{gap:.4g}", count=len(far),
            plural="s" if len(far) > 1 else "",
        )  # fmt: skip


def _near_misses(
    deck: Deck, sections: Sequence[BulkSection], meshes: Sequence[_Mesh], at: tuple[int, int],
    joined: set[tuple[Point, Point]],
) -> Iterator[Notice]:  # fmt: skip
    """Notice of points of two sections that are not joined although they are much closer than the mesh is fine."""
    i, j = at
    if not _searched(deck, sections, i, j):
        return
    reach = min(meshes[i].reach, meshes[j].reach)
    if reach <= 0.0:
        return
    gaps, near = meshes[j].tree.query(meshes[i].xyz, distance_upper_bound=reach)
    used = {point for pair in joined for point in pair}
    ids = [sections[k].structure.nodes.ids for k in at]
    missed: list[tuple[float, int, int]] = []
    for row in np.flatnonzero(np.isfinite(gaps)).tolist():
        to, gap = int(near[row]), float(gaps[row])
        a, b = int(ids[0][row]), int(ids[1][to])
        spacing = min(meshes[i].spacing[row], meshes[j].spacing[to])
        if gap <= _NEAR_MISS * spacing and (i, a) not in used and (j, b) not in used:
            missed.append((gap, a, b))
    if missed:
        gap, a, b = min(missed)
        yield Notice(
            "deck.superelement/near-miss", where=_where(deck, sections, i, j), one=a, other=b, distance=f"{gap:.4g}",
            first=sections[i].number, second=sections[j].number, count=len(missed),
            plural="s" if len(missed) > 1 else "",
        )  # fmt: skip


def _listed_pairs(card: Card, at: dict[int, int], sections: Sequence[BulkSection]) -> Iterator[tuple[Point, Point]]:
    numbers = card.integer(0), card.integer(1, 0)
    if numbers[0] == numbers[1]:
        raise FemtuneError("deck.superelement/itself", where=card.where(), card=card.record, number=numbers[0])
    unknown = next((n for n in numbers if n not in at), None)
    if unknown is not None:
        raise FemtuneError("deck.superelement/unknown", where=card.where(), card=card.record, number=unknown)
    check, tolerance = card.text(3, "YES") != "NO", card.real(2, _LOCATION_TOLERANCE)
    i, j = (at[n] for n in numbers)
    for a, b in _pairs(card):
        places = []
        for k, number in ((i, a), (j, b)):
            nodes = sections[k].structure.nodes
            if not (nodes.has_grid(number) or nodes.has_scalar(number)):
                raise FemtuneError(
                    "deck.superelement/no-point", where=card.where(), card=card.record, point=number,
                    number=sections[k].number,
                )  # fmt: skip
            places.append(nodes.xyz[nodes.position(number)] if nodes.has_grid(number) else None)
        one, other = places
        if (one is None) != (other is None):
            raise FemtuneError("deck.superelement/point-kinds", where=card.where(), card=card.record, one=a, other=b)
        if check and one is not None and other is not None and (gap := float(np.linalg.norm(one - other))) > tolerance:
            raise FemtuneError(
                "deck.superelement/apart", where=card.where(), card=card.record, one=a, other=b, distance=gap,
                tolerance=tolerance,
            )  # fmt: skip
        yield (i, a), (j, b)


def _pairs(card: Card) -> Iterator[tuple[int, int]]:
    """Pairs of the continuations: ``A1 B1 A2 B2 …``, or ``A1 THRU A2 B1 THRU B2`` on a separate line."""
    for start in range(8, len(card.fields), 8):
        if card.text(start + 1) == "THRU":
            user = CardEntry(card, CATALOGUE[card.name].fields)
            one, other = (listed_numbers(user, [card.text(k) for k in range(at, at + 3)]) for at in (start, start + 3))
            if len(one) != len(other):
                raise card.error("deck.field-value/superelement-pairs", index=start)
            yield from zip(one, other)
            continue
        for at in range(start, start + 8, 2):
            if not card.blank(at) or not card.blank(at + 1):
                yield card.integer(at), card.integer(at + 1)


def _searched(deck: Deck, sections: Sequence[BulkSection], i: int, j: int) -> list[Card | None]:
    """SEBULK cards, or None for their defaults, of the sections whose boundary points are searched by their places."""
    cards = [_bulk_card(deck, sections[k].number) for k in (i, j) if sections[k].number]
    return [card for card in cards if card is None or card.text(3, "AUTO") == "AUTO"]


def joined_pairs(
    deck: Deck, sections: Sequence[BulkSection], meshes: Sequence[_Mesh], i: int, j: int
) -> Iterator[tuple[Point, Point]]:
    """Coincident points of two sections."""
    searched = _searched(deck, sections, i, j)
    if not searched:
        return
    tolerance = max(_LOCATION_TOLERANCE if card is None else card.real(4, _LOCATION_TOLERANCE) for card in searched)
    one, other = ((k, _candidates(deck, sections[k], sections[m].number)) for k, m in ((i, j), (j, i)))
    if not len(one[1]) or not len(other[1]):
        return
    xyz = [meshes[k].xyz[np.searchsorted(sections[k].structure.nodes.ids, numbers)] for k, numbers in (one, other)]
    tree = meshes[j].tree if len(xyz[1]) == len(meshes[j].xyz) else cKDTree(xyz[1])
    # the second neighbour shows whether the first is unique
    gaps, near = tree.query(xyz[0], k=2, distance_upper_bound=max(tolerance, 0.0) * (1.0 + 1e-12))
    taken: dict[int, int] = {}
    for row in np.flatnonzero(np.isfinite(gaps[:, 0])).tolist():
        to, a = int(near[row, 0]), int(one[1][row])
        if np.isfinite(gaps[row, 1]) or to in taken:
            twice = [int(other[1][k]) for k in near[row]] if np.isfinite(gaps[row, 1]) else [taken[to], a]
            raise FemtuneError(
                "deck.superelement/ambiguous", where=_where(deck, sections, i, j), one=sections[i].number,
                other=sections[j].number, points=" and ".join(map(str, twice)),
            )  # fmt: skip
        taken[to] = a
        yield (i, a), (j, int(other[1][to]))


def _where(deck: Deck, sections: Sequence[BulkSection], i: int, j: int) -> Where:
    line = deck.parts[sections[j].number]
    return Where(line.file, line.number, f"BEGIN SUPER {sections[j].number}")


def _candidates(deck: Deck, section: BulkSection, other: int) -> Integers:
    """Grid points of a section that may be joined to another: those of SEBNDRY or all, without those of SEEXCLD."""
    ids = section.structure.nodes.ids
    listed = _listed(deck, "SEBNDRY", section.number, other)
    if listed:
        ids = np.array([n for n in ids.tolist() if any(n in some for some in listed)], np.int64)
    left_out = _listed(deck, "SEEXCLD", section.number, other)
    return np.array([n for n in ids.tolist() if not any(n in some for some in left_out)], np.int64) if left_out else ids


def _listed(deck: Deck, name: str, number: int, other: int) -> list[IntegerList]:
    return [
        read_list(card.fields[2:], card.where())
        for card in deck.by_name(name)
        if card.integer(0) == number and (card.text(1) == "ALL" or card.integer(1, other) == other)
    ]


# ----------------------------------------------------------------------------------------------------
# Reduced matrices of external superelements, on the boundary that EXTRN lists.


def reduced_matrices(building: Building, grids: Grids, whole: Deck) -> list[AssembledMatrix]:
    """Stiffness, mass and damping of an external superelement reduced in another run; empty for other parts.

    Raises
    ------
    FemtuneError : ``deck.superelement`` (no file, no such matrix, another size), ``matrices.*``
    """
    deck = building.deck
    card = _bulk_card(whole, deck.section or 0)
    kind = _PRIMARY if card is None else card.text(1, _PRIMARY)
    if card is None or kind == _PRIMARY:
        return []
    if kind == _DMIG:
        return list(_of_dmig(building, grids, card))
    path = _assigned(whole, card)
    if not path.is_file():
        raise FemtuneError("matrices.unreadable/missing", where=Where(str(path)))
    names = [header.name for header in op4_names(path)]
    dofs = _boundary(building, grids, card)
    matrices = []
    for matrix, known in _NAMES:
        name = next((n for n in known if n in names), None)
        if name is None and matrix in _NEEDED:
            shown = ", ".join(names[:10])
            raise FemtuneError(
                "deck.superelement/no-matrix", where=Where(str(path)), card=card.record, wanted=known[0], names=shown
            )
        if name is not None:
            given = read_op4(path, name)
            if given.size == len(dofs):
                matrices.append(
                    scaled_matrix(building, matrix, f"{card.record} {name}", _placed(given, dofs, grids), name)
                )
            elif matrix in _NEEDED or given.size > 1:
                raise FemtuneError(
                    "deck.superelement/size", where=Where(str(path)), name=name, rows=given.size, boundary=len(dofs)
                )
    return matrices


def _of_dmig(building: Building, grids: Grids, card: Card) -> Iterator[AssembledMatrix]:
    """Matrices of DMIG cards that case control does not select; in most runs K2GG and M2GG select them."""
    selected = any(c.name in ("K2GG", "M2GG") for c in building.deck.case_control.effective)
    names = dmig_names(building.deck)
    for matrix, known in () if selected else _NAMES:
        name = next((n for n in known if n in names), None)
        if name is not None:
            upper = dmig_upper(building.deck, name, grids)
            yield scaled_matrix(building, matrix, f"{card.record} {name}", upper, name)
        elif matrix in _NEEDED:
            raise FemtuneError(
                "deck.superelement/no-matrix", where=card.where(), card=card.record, wanted=known[-1],
                names=", ".join(names[:10]) or "no DMIG cards",
            )  # fmt: skip


def _assigned(deck: Deck, card: Card) -> Path:
    """File that ASSIGN gives to the unit of a SEBULK card."""
    unit = card.integer(6, 0)
    lines = [line.body for line in deck.executive.lines]
    for i, body in enumerate(lines):
        match = _ASSIGN.match(body.strip())
        if match is None:
            continue
        # a line that ends with a comma continues in the next one
        rest = match[4] + (lines[i + 1] if match[4].rstrip().endswith(",") and i + 1 < len(lines) else "")
        given = _UNIT.search(rest)
        if given and int(given[1]) == unit:
            return Path(deck.path).parent / (match[1] or match[2] or match[3])
    raise FemtuneError("deck.superelement/no-file", where=card.where(), card=card.record, unit=unit)


def _boundary(building: Building, grids: Grids, card: Card) -> list[int]:
    """g-set DOFs of the rows of the matrices, in the order of EXTRN."""
    records = building.records("EXTRN")
    if not records:
        raise FemtuneError("deck.superelement/no-boundary", where=card.where(), card=card.record)
    dofs = []
    for record in records:
        for at in range(0, len(record.card.fields), 2):
            if not record.card.blank(at):
                number = record.card.integer(at)
                dofs += [grids.dof(number, int(c), record) for c in record.card.component(at + 1, "0")]
    return dofs


def _placed(matrix: ReadMatrix, dofs: Sequence[int], grids: Grids) -> sp.csr_array:
    n, at, entries = grids.table.n_dofs, np.array(dofs), sp.coo_array(matrix.upper)
    row, col = at[entries.row], at[entries.col]
    upper = sp.csr_array((entries.data, (np.minimum(row, col), np.maximum(row, col))), shape=(n, n))
    upper.sort_indices()
    return upper
