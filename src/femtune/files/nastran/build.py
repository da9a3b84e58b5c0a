"""From the cards of a deck to a Structure, with an inventory of cards and the place of each value in the deck."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path

from femtune.errors import ErrorCollector, FemtuneError, Notice, Where
from femtune.fem.joined import Increase, StructurePart, join
from femtune.fem.structure import ElementBatch, Structure
from femtune.files.built_model import BuiltModel
from femtune.files.nastran.building import Building, duplicate
from femtune.files.nastran.card import Card, CardEntry, records_of
from femtune.files.nastran.catalogue import CATALOGUE, ELEMENT, ELEMENT_READERS, NAMESPACES
from femtune.files.nastran.columns import plain_numbers
from femtune.files.nastran.constraints import read_dof_sets, read_multipoint_sets, read_supports
from femtune.files.nastran.control import (
    EigenMethod,
    check_selected,
    coupled_mass,
    drilling_factor,
    eigen_methods,
    hold_singular,
    ignored_params,
    mass_factor,
    normal_angle,
    real_param,
    selected_equations,
)
from femtune.files.nastran.damping import damping_notices, damping_tables, modal_damping, overall_damping
from femtune.files.nastran.deck import Deck, DeckParameter
from femtune.files.nastran.doubtful_values import value_notices
from femtune.files.nastran.general import read_general_elements
from femtune.files.nastran.grids import Grids, permanent_constraints, read_grids
from femtune.files.nastran.health import health_notices
from femtune.files.nastran.inventory import (
    MISSING,
    CardUse,
    ignored_notices,
    missing_error,
    missing_notice,
    take_inventory,
)
from femtune.files.nastran.left_out import left_out, preloads
from femtune.files.nastran.lines import parse_integer, parse_number
from femtune.files.nastran.lists import IntegerList
from femtune.files.nastran.loads import read_preload
from femtune.files.nastran.masses import add_nonstructural_mass
from femtune.files.nastran.materials import read_materials
from femtune.files.nastran.matrices import read_direct_matrices
from femtune.files.nastran.reading import ElementReading
from femtune.files.nastran.rigid import read_rigid
from femtune.files.nastran.selections import unselected_notices
from femtune.files.nastran.source import SourceLine
from femtune.files.nastran.superelements import (
    BulkSection,
    boundary_pairs,
    increase_notice,
    moved_basic,
    reduced_matrices,
    superelement_notices,
)
from femtune.files.nastran.surplus import surplus_fields
from femtune.model.damping import ModalDamping

_MOST_SHOWN = 20
"""Number of errors that are reported together; more fill the screen and often have one cause."""


@dataclass(frozen=True, kw_only=True)
class BuiltDeck(BuiltModel):
    """A structure, and its relation to the deck.

    Parameters
    ----------
    deck : the deck
    eigen_method : modes that the selected EIGR or EIGRL card requests, None if none is selected
    mass_reference : grid point of PARAM GRDPNT (0 for the origin of the basic frame), or None
    increases : increases of the numbers of superelements in parts, by the number of the superelement
    """

    deck: Deck
    eigen_method: EigenMethod | None
    mass_reference: int | None
    increases: Mapping[int, Increase] = field(default_factory=dict)

    @property
    def params(self) -> Mapping[str, DeckParameter]:
        return self.deck.params

    @property
    def sets(self) -> Mapping[int, IntegerList]:
        return self.deck.case_control.sets

    @property
    def executive_lines(self) -> Sequence[SourceLine]:
        return self.deck.executive.lines

    @property
    def damping_number(self) -> int | None:
        return self.deck.case_control.damping

    @property
    def property_of_elements(self) -> Mapping[int, int]:
        properties = {}
        for number, at in self.element_cards.items():
            card = self.deck.cards[at]
            if "PID" in CATALOGUE[card.name].fields:
                more = self.increases.get(card.superelement, Increase())
                own = number - more.elements
                properties[number] = int(element_record(card, own).integer("PID", own)) + more.cards
        return properties

    def cards_named(self, name: str) -> Sequence[Card]:
        return self.deck.by_name(name)

    def place_of_grid(self, grid: int | None) -> Where:
        cards = (card for card in self.deck.by_name("GRID") if card.is_integer(0) and card.integer(0) == grid)
        card = next(cards, None)
        return Where(str(Path(self.files[0]))) if card is None else card.where()

    def place_of_element(self, element: int) -> Where | None:
        at = self.element_cards.get(element)
        return None if at is None else self.deck.cards[at].where()


def build_structure(deck: Deck, allow_missing: bool = False, preloaded: bool = True) -> BuiltDeck:
    """The structure that a deck describes.

    Parameters
    ----------
    deck : a deck that was read
    allow_missing : True to leave out unsupported elements and constraints, with a warning
    preloaded : False to leave out a static preload, with a warning

    Raises
    ------
    FemtuneError : all errors of the deck together (codes ``deck.…``)
    """
    building = Building(deck.of_section(0) if deck.parts else deck)
    building.notices += superelement_notices(deck)
    cards = take_inventory(deck)
    _report_cards(building, cards, allow_missing, preloaded)
    element_cards = _element_cards(building)
    structure = _structure(building, element_cards, preloaded)
    increases: dict[int, Increase] = {}
    if deck.parts:
        structure, element_cards, increases = _with_parts(building, deck, structure, element_cards)
    structure = _with_selected_sets(building, structure)
    method = _eigen_method(building)
    reference = _mass_reference(building)
    tables = damping_tables(building)
    damping = modal_damping(building, tables)
    building.notices += damping_notices(building)
    raise_distinct(building.errors)
    if not structure.nodes.n_dofs:
        # without points there would be errors for every parameter and sensor
        where = Where(str(deck.files[0].file))
        raise FemtuneError("deck.no-points", where=where, values={"cards": len(deck.cards)})
    notices = (*deck.notices, *building.notices, *_without_point(deck))
    notices += tuple(_health(deck, building, structure, element_cards, tables))
    return BuiltDeck(
        files=tuple(file.file for file in deck.files), structure=structure, notices=notices, modal_damping=damping,
        damping_tables=tables, cards=cards, fields=building.places, element_cards=element_cards,
        deck=deck, eigen_method=method, mass_reference=reference, increases=increases,
    )  # fmt: skip


def _health(
    deck: Deck,
    building: Building,
    structure: Structure,
    element_cards: Mapping[int, int],
    tables: Mapping[int, ModalDamping],
) -> list[Notice]:
    """Doubts about the model; a remark if they cannot be told, because they must not cost the model."""
    main = Where(str(deck.path))

    def place_of_grid(number: int) -> Where:
        card = next((c for c in deck.by_name("GRID") if c.is_integer(0) and c.integer(0) == number), None)
        return main if card is None else card.where()

    try:
        return [
            *health_notices(structure, lambda n: deck.cards[element_cards[n]].where(), place_of_grid),
            *value_notices(deck, structure.values, building.places, tables),
        ]
    except (FemtuneError, ValueError, LookupError, ArithmeticError) as error:
        return [Notice("deck.health-unknown", where=main, level="info", problem=type(error).__name__)]


def _without_point(deck: Deck) -> list[Notice]:
    """Notice of real numbers without decimal point, which commercial programs read; it shows one that is not zero."""
    cards = [(card, card.without_point) for card in deck.cards if card.without_point is not None]
    if not cards:
        return []
    card, index = next((c for c in cards if parse_number(c[0].text(c[1]))), cards[0])
    place, value = card.field_name(index), card.text(index)
    level = "warning" if parse_integer(value) else "info"
    return [
        Notice(
            "deck.without-point", where=card.where(index), level=level, record=card.record, field=place, text=value,
            count=len(cards), plural="s" if len(cards) > 1 else "",
        )
    ]  # fmt: skip


def element_record(card: Card, number: int) -> CardEntry:
    """The entry of an element on its card, which may hold two."""
    records = records_of(card)
    return records[0] if len(records) == 1 else next(r for r in records if r.integer("EID") == number)


def build_allowing(deck: Deck, names: Collection[str]) -> BuiltDeck:
    """The structure of a deck whose cards and commands a study may permit to be ignored; errors as above."""
    return build_structure(deck, bool(names), "STATSUB" not in {name.upper() for name in names})


def _report_cards(building: Building, cards: tuple[CardUse, ...], allow_missing: bool, preloaded: bool) -> None:
    building.notices += [*ignored_notices(cards), *ignored_params(building.deck), *left_out(building.deck, preloaded)]
    building.notices += surplus_fields(building.deck)
    building.notices += unselected_notices(building.deck)
    missing = [count for count in cards if count.use == MISSING]
    if allow_missing:
        building.notices += [missing_notice(count) for count in missing]
    else:
        building.errors.errors += [*map(missing_error, missing), *preloads(building.deck).values()]


def _with_parts(
    building: Building, deck: Deck, residual: Structure, element_cards: Mapping[int, int]
) -> tuple[Structure, dict[int, int], dict[int, Increase]]:
    """The whole of a deck with superelements in parts: structure, card of each element, and increases of numbers.

    Also gathers values, errors and notices of the parts.
    """
    case = deck.case_control
    parts, cards, places = [StructurePart(residual, 0, case.spc, case.mpc)], [element_cards], [building.places]
    for number in deck.parts:
        part_building = Building(deck.of_section(number), errors=building.errors, basic=moved_basic(deck, number))
        cards.append(_element_cards(part_building))
        structure = _structure(part_building, cards[-1], False, deck)
        parts.append(
            StructurePart(structure, number, part_building.deck.case_control.spc, part_building.deck.case_control.mpc)
        )
        places.append(part_building.places)
        # the sets of a part describe its reduction, which has a single notice
        building.notices += [n for n in part_building.notices if not n.code.startswith("deck.dof-set")]
        building.notices += unselected_notices(part_building.deck)
    raise_distinct(building.errors)
    pairs = boundary_pairs(deck, [BulkSection(part.number, part.structure) for part in parts], building.notices)
    try:
        joined = join(parts, pairs)
    except OverflowError as error:
        line = next(iter(deck.parts.values()))
        raise FemtuneError("deck.superelement/large-numbers", where=Where(line.file, line.number)) from error
    each = list(zip(parts, joined.increases, cards, places))
    building.places = {
        part.in_whole(ref, more): at for part, more, _, part_building in each for ref, at in part_building.items()
    }
    building.notices += [increase_notice(deck, part.number, more) for part, more, _, _ in each if more]
    merged = {n + more.elements: at for _, more, found, _ in reversed(each) for n, at in found.items()}
    return joined.structure, merged, {part.number: more for part, more, _, _ in each}


def _with_selected_sets(building: Building, structure: Structure) -> Structure:
    """The structure with the sets that case control selects, which must exist (error ``deck.missing-set``)."""
    supports, multipoint = structure.support_sets, structure.multipoint_sets
    check_selected(building, "SPC", structure.default_support_set, supports)
    equations = selected_equations(building, structure.default_multipoint_set, multipoint)
    preload = structure.preload
    if preload is not None:
        check_selected(building, "SPC", preload.support_set, supports)
        check_selected(building, "MPC", preload.multipoint_set, multipoint)
    return replace(structure, default_multipoint_set=equations)


def _structure(
    building: Building, element_cards: Mapping[int, int], preloaded: bool, whole: Deck | None = None
) -> Structure:
    """The structure of the main bulk data, or of a superelement of the whole deck."""
    deck = building.deck
    grids = read_grids(building)
    batches = add_nonstructural_mass(building, grids.table, _batches(building, grids))
    damping = overall_damping(building)
    direct = (*read_direct_matrices(building, grids), *read_general_elements(building, grids))
    if whole is not None:
        with building.errors.catch():
            direct += tuple(reduced_matrices(building, grids, whole))
    supports = read_supports(building, grids)
    multipoint = read_multipoint_sets(building, grids)
    preload = read_preload(building, grids, batches) if preloaded else None
    return Structure(
        nodes=grids.table,
        values=building.values.table(),
        batches=tuple(batches),
        rigid=read_rigid(building, grids),
        multipoint_sets=multipoint,
        support_sets=supports,
        permanent=permanent_constraints(building, grids),
        default_support_set=deck.case_control.spc,
        default_multipoint_set=deck.case_control.mpc,
        mass_factor=mass_factor(building),
        consistent_mass=coupled_mass(building),
        hold_singular=hold_singular(building),
        dof_sets=read_dof_sets(building, grids),
        drilling=drilling_factor(building, batches),
        normals_within=normal_angle(building),
        damping=damping,
        assembled=direct,
        preload=preload,
        element_kinds={number: deck.cards[at].name for number, at in element_cards.items()},
    )


def _batches(building: Building, grids: Grids) -> list[ElementBatch]:
    materials = read_materials(building)
    batches: list[ElementBatch] = []
    for name in ELEMENT_READERS:
        module, function = name.split(".")
        read: _ElementReader = getattr(import_module(f"{__package__}.{module}"), function)
        batches += read(ElementReading(building, grids, materials, tuple(batches)))
    return batches


_ElementReader = Callable[[ElementReading], list[ElementBatch]]


def _element_cards(building: Building) -> dict[int, int]:
    """Card of each element; numbers are unique within a namespace, and the card of an elastic element has priority."""
    spaces: dict[str, dict[int, int]] = {space: {} for space in NAMESPACES}
    for kind in (kind for kind in CATALOGUE.values() if kind.role == ELEMENT):
        cards, numbered = building.deck.by_name(kind.name), spaces[kind.namespace]
        # several elements on a card are read one by one
        numbers = plain_numbers(cards) if len(kind.starts) == 1 else None
        if numbers is not None and numbered.keys().isdisjoint(numbers) and min(numbers) > 0:
            numbered.update(zip(numbers, (card.position for card in cards)))
        else:
            _add_one_by_one(building, kind.name, numbered)
    merged: dict[int, int] = {}
    for numbered in spaces.values():
        if merged and (shared := merged.keys() & numbered.keys()):
            building.notices.append(_shared(building, min(shared), len(shared), merged, numbered))
        merged = {**numbered, **merged} if merged else numbered
    return merged


def _shared(
    building: Building, number: int, count: int, first: Mapping[int, int], second: Mapping[int, int]
) -> Notice:  # fmt: skip
    """Notice of numbers that occur in two namespaces of elements."""
    one, other = (building.deck.cards[cards[number]] for cards in (first, second))
    more = f" and {count - 1} more" if count > 1 else ""
    return Notice(
        "deck.shared-number",
        where=other.where(),
        level="info",
        number=f"{number}{more}",
        one=one.name,
        other=other.name,
    )


def _add_one_by_one(building: Building, name: str, cards: dict[int, int]) -> None:
    for record in building.records(name):
        with building.errors.catch():
            number = record.integer("EID")
            if number < 1:
                raise record.error("deck.field-value/element-number", at="EID")
            first = building.deck.cards[cards[number]] if number in cards else None
            if first is not None and not (_in_own_numbers(name) and _in_own_numbers(first.name) and name != first.name):
                raise duplicate(record.card, f"element {number}", first)
            cards[number] = record.card.position


def _in_own_numbers(name: str) -> bool:
    """Whether a kind of element may have the numbers of another such kind: rigid elements of NASTRAN-95."""
    return name.startswith("CRIGD")


def _eigen_method(building: Building) -> EigenMethod | None:
    methods = eigen_methods(building)
    selected = building.deck.case_control.method
    check_selected(building, "METHOD", selected, methods)
    return None if selected is None else methods.get(selected)


def _mass_reference(building: Building) -> int | None:
    value = real_param(building, "GRDPNT", -1.0)
    return int(value) if value >= 0 else None


def raise_distinct(errors: ErrorCollector) -> None:
    """Raise each problem once, and at most twenty of them."""
    distinct = list({str(error): error for error in errors.errors}.values())
    shown = distinct[:_MOST_SHOWN]
    if len(distinct) > len(shown):
        rest = len(distinct) - len(shown)
        shown.append(FemtuneError("deck.more-problems", rest=rest))
    ErrorCollector(shown).raise_if_any()
