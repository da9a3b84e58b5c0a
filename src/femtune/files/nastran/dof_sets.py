"""Named sets of degrees of freedom: ASET, OMIT, BSET, CSET, QSET, SUPORT, USET and their second forms.

They tell which degrees of freedom a reduction keeps or how a support is taken; none of them holds anything here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.record import Record
from femtune.files.nastran.supports import dofs_of_point, listed_dofs

Integers = NDArray[np.int64]

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

_REDUCED = "the model is not reduced, all its DOFs are kept"
_FOUND = "they are not held, rigid-body modes are found without them"
_EFFECTS = {
    **dict.fromkeys((*_KEPT, "OMIT"), _REDUCED),
    **dict.fromkeys(("SUPORT", "SUPORT1"), _FOUND),
    "USET": "a set of its own that changes nothing",
}


def read_dof_sets(building: Building, grids: Grids) -> dict[str, Integers]:
    """g-set DOFs by set: "ASET", "OMIT", "BSET", "CSET", "QSET", "SUPORT", "SUPORT1 3", "USET U1".

    BNDFIX is BSET and BNDFREE is CSET. A notice tells of each set that nothing depends on it.
    """
    found: dict[str, set[int]] = {}
    first: dict[str, Record] = {}
    for record in building.records(*_PAIRED, *_LISTED):
        with building.errors.catch():
            name, dofs = _set_name(record), _dofs(record, grids)
            found.setdefault(name, set()).update(dofs)
            first.setdefault(name, record)
    building.notices += [_notice(name, len(dofs), first[name]) for name, dofs in found.items()]
    building.notices += _overlaps(found, first, grids)
    return {name: np.array(sorted(dofs), dtype=np.int64) for name, dofs in found.items()}


def _set_name(record: Record) -> str:
    name, _ = (_PAIRED | _LISTED)[record.name]
    if name == "SUPORT1":
        return f"SUPORT1 {record.integer('SID')}"
    if name != "USET":
        return name
    given = record.text("SNAME")
    if given in _SYNONYMS:
        return _SYNONYMS[given]
    if not _USER_SET.fullmatch(given):
        raise record.error("deck.field-value", f"the set '{given}' of {record.name} is not read", at="SNAME",
                           hint="known: U1 to U6, A, B, C, O, Q, R; hold DOFs by SPC1")  # fmt: skip
    return f"USET {given}"


def _dofs(record: Record, grids: Grids) -> set[int]:
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
            raise card.error("deck.field-value", "components stand here without a grid point", index=at,
                             hint="fill the field with a grid point, or empty the next one")  # fmt: skip


def _notice(name: str, count: int, record: Record) -> Notice:
    what = f"{name} names {count} DOF{'s' if count != 1 else ''}: {effect_of(name)}"
    return Notice("deck.dof-set", what, record.where, "info")


def effect_of(name: str) -> str:
    """What a set of `read_dof_sets` means for the model, in words."""
    kind = name.split(maxsplit=1)[0]
    return _EFFECTS[kind]


def _overlaps(found: dict[str, set[int]], first: dict[str, Record], grids: Grids) -> Iterable[Notice]:
    """A DOF that is omitted and kept: other programs refuse it; here neither has an effect."""
    for name in _KEPT:
        both = found.get("OMIT", set()) & found.get(name, set())
        if both:
            dof = grids.table.describe(min(both))
            what = f"component {dof.component} of node {dof.node} is in OMIT and in {name}; Nastran refuses that"
            yield Notice("deck.dof-set-overlap", what, first[name].where)
