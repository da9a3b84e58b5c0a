"""Multipoint constraints: MPC and MPCADD as sets of equations, the first DOF of each dependent."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable

import numpy as np

from femtune.arrays import Integers
from femtune.errors import FemtuneError, Notice
from femtune.fem.structure import ConstraintRows, join_constraints
from femtune.files.nastran.building import Building, listed_numbers
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.grids import Grids, unknown_grid
from femtune.files.nastran.lists import read_list
from femtune.files.nastran.selections import selected_numbers

# ----------------------------------------------------------------------------------------------------
# Supports: SPC, SPC1 and SPCADD as sets of held g-set DOFs.


def read_supports(building: Building, grids: Grids) -> dict[int, Integers]:
    """Held DOFs of each set, those of SPCADD included."""
    held: dict[int, set[int]] = {}
    for record in building.records("SPC", "SPC1"):
        with building.errors.catch():
            number = record.integer("SID")
            dofs = (
                _single(building, record, grids)
                if record.name == "SPC"
                else listed_dofs(record, grids, record.component("C", "0"), 2)
            )
            held.setdefault(number, set()).update(dofs)
    used = selected_numbers(building.deck.case_control, "SPC")
    for number, parts in read_unions(building, "SPCADD", set(held), used).items():
        held[number] = set().union(*(held[part] for part in parts))
    return {number: np.array(sorted(dofs), dtype=np.int64) for number, dofs in held.items()}


def read_unions(
    building: Building, card: str, known: set[int], used: Collection[int] | None = None
) -> dict[int, list[int]]:
    """Members of the sets that SPCADD or MPCADD combine.

    A union cannot also have SPC or MPC cards, and its members cannot be unions, as in Nastran. Unions that are not
    `used` are left out where they are not valid: Nastran does not read them.
    """
    unions: dict[int, list[int]] = {}
    numbers = {record.card.integer(0, 0) for record in building.records(card) if record.card.is_integer(0)}
    for record in building.records(card):
        with building.errors.catch():
            number, parts = record.integer("SID"), listed_numbers(record, record.card.fields[1:])
            missing = [part for part in parts if part not in known]
            if (missing or number in known) and used is not None and number not in used:
                continue
            if missing or number in known:
                nested = [part for part in missing if part in numbers]
                raise _nested(record, number, nested[0]) if nested else _bad_union(record, number, missing, card)
            unions.setdefault(number, []).extend(parts)
    return unions


def _bad_union(record: CardEntry, number: int, missing: list[int], card: str) -> FemtuneError:
    if missing:
        return record.error("deck.missing-set/missing-part", union_card=card, number=number, missing=missing[0])
    return record.error("deck.missing-set/number-of-union", number=number, union_card=card)


def _nested(record: CardEntry, number: int, part: int) -> FemtuneError:
    return record.error("deck.missing-set/nested", record_name=record.name, number=number, part=part)


def _single(building: Building, record: CardEntry, grids: Grids) -> set[int]:
    """SPC: up to two points with their components."""
    dofs: set[int] = set()
    for end in "12":
        number = record.integer("G" + end, 0)
        if number == 0:
            continue
        dofs |= dofs_of_point(record, grids, number, record.component("C" + end, "0"))
        if record.real("D" + end, 0.0) != 0.0:
            building.notices.append(_enforced(record, number))
    return dofs


def _enforced(record: CardEntry, number: int) -> Notice:
    return Notice("deck.enforced-displacement", where=record.where, number=number)


def listed_dofs(record: CardEntry, grids: Grids, components: str, start: int) -> set[int]:
    """Components of a list of points from field `start` on; points that are only within a THRU range may be missing."""
    points = read_list(record.card.fields[start:], record.where)
    missing = [n for n in points.singles if n not in grids.points]
    if missing:
        raise unknown_grid(missing[0], record)
    numbers = points.among(grids.points) if points.spans or points.every else points.singles
    return {dof for number in numbers for dof in dofs_of_point(record, grids, number, components)}


def dofs_of_point(record: CardEntry, grids: Grids, number: int, components: str) -> set[int]:
    """g-set DOFs of components of a grid point or scalar point that a card names."""
    if number in grids.records and components == "0":
        raise record.error("deck.field-value/components-of-point", number=number)
    return {grids.dof(number, int(c), record) for c in components}


_LARGEST_RATIO = 1e30
"""Largest ratio of a coefficient to the dependent one; its square times a stiffness does not overflow."""


def read_multipoint_sets(building: Building, grids: Grids) -> dict[int, ConstraintRows]:
    """Equations of each MPC set, those of MPCADD included."""
    parts: dict[int, list[ConstraintRows]] = {}
    used, left_out = _used_equations(building), set()
    for record in building.records("MPC"):
        with building.errors.catch():
            number = record.integer("SID")
            try:
                parts.setdefault(number, []).append(_equation(record, grids))
            except FemtuneError as error:
                if error.code != "deck.unknown-grid" or number in used:
                    raise
                # Nastran does not read sets that are not selected
                if number not in left_out:
                    building.notices.append(_unused(record, number, error))
                left_out.add(number)
    parts = {number: rows for number, rows in parts.items() if number not in left_out}
    for number, members in read_unions(building, "MPCADD", set(parts)).items():
        parts[number] = [rows for member in members for rows in parts[member]]
    return {number: join_constraints(rows) for number, rows in parts.items()}


def _used_equations(building: Building) -> set[int]:
    """Numbers of the MPC sets that case control selects, directly or by MPCADD; all that an MPCADD names."""
    case = building.deck.case_control
    subcases = (case, case.preload) if case.preload else (case,)
    named = {n for record in building.records("MPCADD") for n in listed_numbers(record, record.card.fields[1:])}
    return named | {subcase.mpc for subcase in subcases if subcase.mpc is not None}


def _unused(record: CardEntry, number: int, error: FemtuneError) -> Notice:
    return Notice("deck.unselected-set", where=record.where, number=number, grid=error.facts.get("number"))


def _equation(record: CardEntry, grids: Grids) -> ConstraintRows:
    terms = _terms(record, grids)
    if not terms or terms[0][1] == 0.0:
        raise record.error("deck.field-value/mpc-first-coefficient")
    if max(abs(a) for _, a in terms) > _LARGEST_RATIO * abs(terms[0][1]):
        raise record.error("deck.field-value/mpc-large-coefficient")
    dofs = np.array([dof for dof, _ in terms], dtype=np.int64)
    coefficients = np.array([a for _, a in terms])
    rows, owner = np.zeros(len(terms), np.int64), np.zeros(1, np.int64)
    return ConstraintRows(dofs[:1], rows, dofs, coefficients, owner)


def _terms(record: CardEntry, grids: Grids) -> list[tuple[int, float]]:
    """DOF and coefficient of each term: two per line, in fields 3 to 8."""
    card, terms = record.card, []
    for line in range(0, len(card.fields), 8):
        for at in (line + 1, line + 4):
            number = card.integer(at, 0)
            if number:
                component = card.component(at + 1, "0")
                if len(component) != 1:
                    raise card.error("deck.field-value/mpc-component", index=at + 1)
                terms.append((grids.dof(number, int(component), record), card.real(at + 2, 0.0)))
    return terms


# ----------------------------------------------------------------------------------------------------
# Named sets of degrees of freedom: ASET, OMIT, BSET, CSET, QSET, SUPORT, USET and their second forms.
#
# They define the degrees of freedom that a reduction retains, or a support; none of them constrains anything here.


# card: name of its set, and the field in which pairs of point and components start
_PAIRED = {
    **{name: (name, 0) for name in ("ASET", "OMIT", "BSET", "CSET", "QSET", "SUPORT")},
    **{"BNDFIX": ("BSET", 0), "BNDFREE": ("CSET", 0), "SUPORT1": ("SUPORT1", 1), "USET": ("USET", 1)},
}
# card: name of its set, and the field of the components, before the list of points
_LISTED = {
    **{name + "1": (name, 0) for name in ("ASET", "OMIT", "BSET", "CSET", "QSET")},
    **{"BNDFIX1": ("BSET", 0), "BNDFRE1": ("CSET", 0), "USET1": ("USET", 1)},
}
_USER_SET = re.compile(r"U[1-6]")
_SYNONYMS = {"A": "ASET", "B": "BSET", "C": "CSET", "O": "OMIT", "Q": "QSET", "R": "SUPORT"}
_KEPT = ("ASET", "BSET", "CSET", "QSET")

_REDUCED = "the model is not reduced; the modes are those with all DOFs, and those of a reduced run are higher"
_COMPONENT = (
    "the component is not reduced; the modes are those with all DOFs and the supports of the deck, whereas a run that "
    "reduces the component holds BSET, leaves CSET free, and lists the modes with these supports"
)
_FOUND = "they are not constrained; rigid-body modes are found without SUPORT"
_EFFECTS = {
    **dict.fromkeys(("ASET", "OMIT", "QSET"), _REDUCED),
    **dict.fromkeys(("BSET", "CSET"), _COMPONENT),
    **dict.fromkeys(("SUPORT", "SUPORT1"), _FOUND),
    "USET": "the set has no effect",
}


def read_dof_sets(building: Building, grids: Grids) -> dict[str, Integers]:
    """g-set DOFs by set: "ASET", "OMIT", "BSET", "CSET", "QSET", "SUPORT", "SUPORT1 3", "USET U1".

    BNDFIX is BSET and BNDFREE is CSET. A notice says for each set that it has no effect.
    """
    sets: dict[str, set[int]] = {}
    first: dict[str, CardEntry] = {}
    for record in building.records(*_PAIRED, *_LISTED):
        with building.errors.catch():
            name, dofs = _set_name(record), _dofs(record, grids)
            sets.setdefault(name, set()).update(dofs)
            first.setdefault(name, record)
    building.notices += [_notice(name, len(dofs), first[name]) for name, dofs in sets.items()]
    building.notices += _overlaps(sets, first, grids)
    return {name: np.array(sorted(dofs), dtype=np.int64) for name, dofs in sets.items()}


def _set_name(record: CardEntry) -> str:
    name, _ = (_PAIRED | _LISTED)[record.name]
    if name == "SUPORT1":
        return f"SUPORT1 {record.integer('SID')}"
    if name != "USET":
        return name
    given = record.text("SNAME")
    if given in _SYNONYMS:
        return _SYNONYMS[given]
    if not _USER_SET.fullmatch(given):
        raise record.error("deck.field-value/set-name", at="SNAME", set_name=given, record_name=record.name)
    return f"USET {given}"


def _dofs(record: CardEntry, grids: Grids) -> set[int]:
    if record.name in _LISTED:
        _, at = _LISTED[record.name]
        return listed_dofs(record, grids, record.card.component(at, "0"), at + 1)
    _, start = _PAIRED[record.name]
    return {
        dof
        for number, components in _pairs(record.card, start)
        for dof in dofs_of_point(record, grids, number, components)
    }


def _pairs(card: Card, start: int) -> Iterable[tuple[int, str]]:
    """Point and components; a pair without a point is left out."""
    for at in range(start, len(card.fields), 2):
        if card.integer(at, 0):
            yield card.integer(at), card.component(at + 1, "0")
        elif not card.blank(at + 1) and card.text(at + 1) != "0":
            raise card.error("deck.field-value/components-without-point", index=at)


def _notice(name: str, count: int, record: CardEntry) -> Notice:
    return Notice(
        "deck.dof-set",
        where=record.where,
        level="warning" if effect_of(name) in (_REDUCED, _COMPONENT) else "info",
        set_name=name,
        count=count,
        plural="s" if count != 1 else "",
        effect=effect_of(name),
    )


def effect_of(name: str) -> str:
    """Text on the effect of a set of `read_dof_sets` on the model."""
    kind = name.split(maxsplit=1)[0]
    return _EFFECTS[kind]


def _overlaps(sets: dict[str, set[int]], first: dict[str, CardEntry], grids: Grids) -> Iterable[Notice]:
    """Notices of DOFs that are both omitted and kept: an error in other programs, without effect here."""
    for name in _KEPT:
        both = sets.get("OMIT", set()) & sets.get(name, set())
        if both:
            dof = grids.table.describe(min(both))
            yield Notice(
                "deck.dof-set-overlap", where=first[name].where, component=dof.component, node=dof.node, set_name=name
            )
