"""The elements of a parameter's region: by number, property, material, set of the deck, box, or nearness."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Where
from femtune.files.nastran.build import BuiltModel
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.lists import IntegerList
from femtune.files.nastran.record import Record
from femtune.files.study_file import NearTable, RegionTable, StudyFile, element_list

Reals = NDArray[np.float64]
Numbers = frozenset[int]


@dataclass(frozen=True)
class _Asked:
    """A region as one parameter asks for it."""

    name: str
    built: BuiltModel
    where: Where

    def error(self, what: str, hint: str) -> FemtuneError:
        """An error at the region."""
        text = f"parameter {self.name}: {what}"
        return FemtuneError("parameter.region", text, where=self.where, hint=hint)


def region_of(file: StudyFile, i: int, built: BuiltModel) -> Numbers | None:
    """Elements that parameter i of a study is limited to, None where it is not limited.

    Raises
    ------
    FemtuneError : ``parameter.region`` for what the deck does not have, and where no element is left
    """
    entry = file.parameter[i]
    chosen = _listed(file, i, built)
    if entry.region is None:
        return chosen
    asked = _Asked(entry.name, built, file.where("parameter", i, "region"))
    if entry.region == RegionTable():
        raise asked.error("its region has no condition", "write one, such as properties = [3], or leave region out")
    for condition in _conditions(asked, entry.region):
        chosen = condition if chosen is None else chosen & condition
    if not chosen:
        raise asked.error("no element lies in its region", "widen the region, or take a condition out of it")
    return chosen


def _listed(file: StudyFile, i: int, built: BuiltModel) -> Numbers | None:
    entry = file.parameter[i]
    if entry.elements is None:
        return None
    return _named(_Asked(entry.name, built, file.where("parameter", i, "elements")), element_list(entry.elements))


def _named(asked: _Asked, wanted: IntegerList) -> Numbers:
    known = asked.built.structure.element_kinds
    _known(asked, wanted, set(known), "number")
    return frozenset(wanted.among(known))


def _conditions(asked: _Asked, table: RegionTable) -> Iterable[Numbers]:
    if table.elements is not None:
        yield _named(asked, element_list(table.elements))
    if table.properties is not None:
        yield _with_property(asked, element_list(table.properties))
    if table.materials is not None:
        yield _with_material(asked, element_list(table.materials))
    if table.set is not None:
        yield _in_set(asked, table.set)
    if table.box is not None:
        yield _in_box(asked, np.array(table.box))
    if table.near is not None:
        yield _near(asked, table.near)


def _with_property(asked: _Asked, wanted: IntegerList) -> Numbers:
    owners = property_of_elements(asked.built)
    _known(asked, wanted, set(owners.values()), "property")
    return frozenset(n for n, pid in owners.items() if pid in wanted)


def property_of_elements(built: BuiltModel) -> dict[int, int]:
    """Number of the property card by element number; a blank one is the element's own number."""
    found = {}
    for number, at in built.element_cards.items():
        card = built.deck.cards[at]
        names = CATALOGUE[card.name].fields
        if "PID" in names:
            found[number] = int(Record(card, names).integer("PID", number))
    return found


def _with_material(asked: _Asked, wanted: IntegerList) -> Numbers:
    structure = asked.built.structure
    refs = {i: ref for i, ref in enumerate(structure.values.refs) if ref.card.startswith("MAT")}
    _known(asked, wanted, {ref.id for ref in refs.values()}, "material")
    users = [structure.users(i) for i, ref in refs.items() if ref.id in wanted]
    return frozenset(int(n) for at in users for n in at)


def _known(asked: _Asked, wanted: IntegerList, known: set[int], what: str) -> None:
    """Refuse a number that no element refers to, unless it stands in a range."""
    unknown = sorted(set(wanted.singles) - known)
    if unknown:
        shown = ", ".join(map(str, sorted(known)[:10])) or "none"
        raise asked.error(f"no element has {what} {unknown[0]}", f"elements have {what} {shown}")


def _in_set(asked: _Asked, number: int) -> Numbers:
    sets = asked.built.deck.case_control.sets
    if number not in sets:
        known = ", ".join(map(str, sorted(sets)[:10])) or "none"
        raise asked.error(f"the deck has no SET {number}", f"sets in its case control: {known}")
    return frozenset(sets[number].among(asked.built.structure.element_kinds))


def _in_box(asked: _Asked, corners: Reals) -> Numbers:
    numbers, centres = element_centres(asked.built)
    low, high = corners.min(axis=0), corners.max(axis=0)
    inside = ((centres >= low) & (centres <= high)).all(axis=1)
    return frozenset(map(int, numbers[inside]))


def _near(asked: _Asked, near: NearTable) -> Numbers:
    numbers, centres = element_centres(asked.built)
    # not squared, which overflows far away
    x, y, z = (centres - _place(asked, near)).T
    away = np.hypot(np.hypot(x, y), z)
    return frozenset(map(int, numbers[away <= near.distance]))


def _place(asked: _Asked, near: NearTable) -> Reals:
    given = [key for key in ("point", "node", "element") if getattr(near, key) is not None]
    if len(given) != 1:
        raise asked.error("'near' wants one of point, node and element", "write near = { node = 12, distance = 0.1 }")
    nodes = asked.built.structure.nodes
    if near.point is not None:
        return np.array(near.point)
    if near.node is not None:
        if not nodes.has_grid(near.node):
            raise asked.error(f"grid point {near.node} does not exist", "name a grid point of the deck")
        return nodes.xyz[nodes.position(near.node)]
    return _middle(asked, int(near.element or 0))


def _middle(asked: _Asked, element: int) -> Reals:
    """Mean of the grid points of an element, a rigid one too."""
    structure = asked.built.structure
    numbers, centres = element_centres(asked.built)
    if element in numbers:
        return np.asarray(centres[np.flatnonzero(numbers == element)[0]])
    rigid = structure.rigid.keep(structure.rigid.owner == element)
    at = np.unique(rigid.dof[rigid.dof < 6 * len(structure.nodes.ids)] // 6)
    if not at.size:
        raise asked.error(f"element {element} does not exist", "name an element of the deck")
    return np.asarray(structure.nodes.xyz[at].mean(axis=0))


def element_centres(built: BuiltModel) -> tuple[NDArray[np.int64], Reals]:
    """Numbers of the elements, (n,), and the means of their grid points, (n, 3); none for those on scalar points."""
    structure, numbers, centres = built.structure, [], []
    for batch in structure.batches:
        known = (batch.nodes >= 0) & (batch.nodes < len(structure.nodes.ids))
        some = known.any(axis=1)
        places = np.where(known[:, :, None], structure.nodes.xyz[np.where(known, batch.nodes, 0)], 0.0)
        numbers.append(batch.ids[some])
        centres.append((places.sum(axis=1) / np.maximum(known.sum(axis=1), 1)[:, None])[some])
    return np.concatenate([np.zeros(0, np.int64), *numbers]), np.concatenate([np.zeros((0, 3)), *centres])
