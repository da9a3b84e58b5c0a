"""Damping of the whole model: PARAM G, W3 and W4; notices of implausible and of ignored damping."""

from __future__ import annotations

from collections.abc import Mapping

from femtune.errors import FemtuneError, Notice
from femtune.fem.fields import FieldRef
from femtune.fem.structure import OverallDamping
from femtune.files.nastran.building import Building, FieldPlace
from femtune.files.nastran.card import Card, CardEntry
from femtune.files.nastran.control import check_selected, real_param
from femtune.files.nastran.deck import Deck
from femtune.model.damping import DampingUnit, ModalDamping, as_hysteretic, damping_table

_LARGEST_LOSS_FACTOR = 2.0
"""Loss factor above which a notice is given: damping layers reach about 1, and a percentage is usually larger."""
_MATRICES = ("B2PP",)


def overall_damping(building: Building) -> OverallDamping:
    """PARAM G as an entry of the value table, with W3 and W4 (error ``deck.param`` if they are below zero)."""
    w3, w4 = (_not_negative(building, name) for name in ("W3", "W4"))
    if "G" not in building.deck.params:
        return OverallDamping(None, w3, w4)
    ref, card = FieldRef("PARAM", 0, "G"), building.deck.params["G"].card
    cards = building.deck.cards
    # a PARAM of case control has no card to write to
    if card.position < len(cards) and cards[card.position] is card:
        building.places[ref] = FieldPlace(card.position, (1,))
    return OverallDamping(building.values.add(ref, real_param(building, "G", 0.0)), w3, w4)


def _not_negative(building: Building, name: str) -> float:
    value = real_param(building, name, 0.0)
    if value < 0.0:
        with building.errors.catch():
            card = building.deck.params[name].card
            raise card.error("deck.param/not-negative", index=1, name=name)
    return max(value, 0.0)


def damping_notices(building: Building) -> list[Notice]:
    """Notices of loss factors that no material has, and of damping matrices that are not read."""
    return [*_large_losses(building), *_matrix_notices(building.deck)]


def _large_losses(building: Building) -> list[Notice]:
    table = building.values
    losses = [(r, v) for r, v in zip(table.refs, table.values) if r in building.places and _is_loss(r) and _is_large(v)]
    if not losses:
        return []
    ref, value = losses[0]
    more = f" (and {len(losses) - 1} more)" if len(losses) > 1 else ""
    return [
        Notice(
            "deck.large-loss-factor",
            where=building.deck.cards[building.places[ref].card].where(),
            field=ref,
            value=value,
            more=more,
        )
    ]


def _is_loss(ref: FieldRef) -> bool:
    """A loss factor of a part; that of the whole model (PARAM G) is judged with the damping ratios."""
    return ref.name.startswith("GE")


def _is_large(value: float) -> bool:
    return value > _LARGEST_LOSS_FACTOR


def _matrix_notices(deck: Deck) -> list[Notice]:
    return [
        Notice("deck.damping-matrix", where=c.where, command=c.name, matrix=c.value)
        for c in deck.case_control.effective
        if c.name in _MATRICES
    ]


# ----------------------------------------------------------------------------------------------------
# Modal damping over frequency: TABDMP1, and its selection by case control.


_UNITS: Mapping[str, DampingUnit] = {"G": "G", "CRIT": "CRIT", "Q": "Q"}
_FIRST_PAIR = 8
"""Index of the first frequency of a TABDMP1: the first field of its first continuation."""


def damping_tables(building: Building) -> dict[int, ModalDamping]:
    """Tables of modal damping by number."""
    tables = {}
    for number, record in building.by_number(building.records("TABDMP1"), "table").items():
        with building.errors.catch():
            tables[number] = _table(record)
    return tables


def modal_damping(building: Building, tables: Mapping[int, ModalDamping]) -> ModalDamping | None:
    """The table that SDAMPING selects, interpreted by PARAM KDAMP, or None (error ``deck.missing-set``)."""
    selected = building.deck.case_control.damping
    # an unusable table has a separate error
    known = {card.integer(0, 0) for card in building.deck.by_name("TABDMP1") if card.is_integer(0)}
    check_selected(building, "SDAMPING", selected, known)
    if selected is None or selected not in tables:
        return None
    table = tables[selected]
    return as_hysteretic(table) if real_param(building, "KDAMP", 1.0) < 0.0 else table


def _table(record: CardEntry) -> ModalDamping:
    unit = record.text("TYPE", "G")
    if unit not in _UNITS:
        raise record.error("deck.damping-table/unknown-type", at="TYPE", damping_type=unit)
    pairs = _pairs(record.card)
    try:
        return damping_table([x for x, _ in pairs], [y for _, y in pairs], _UNITS[unit], record.integer("FLAT", 0) == 1)
    except FemtuneError as error:
        raise record.error("deck.damping-table/values", reason=error.what, hint=error.hint) from error


def _pairs(card: Card) -> list[tuple[float, float]]:
    """Frequencies and values up to ENDT; pairs with SKIP and blank pairs are left out."""
    pairs: list[tuple[float, float]] = []
    for at in range(_FIRST_PAIR, len(card.fields), 2):
        texts = (card.text(at), card.text(at + 1))
        if "ENDT" in texts:
            return pairs
        if "SKIP" not in texts and any(texts):
            pairs.append((card.real(at), card.real(at + 1)))
    raise card.error("deck.damping-table")
