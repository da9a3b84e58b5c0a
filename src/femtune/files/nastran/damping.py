"""Damping of the whole model: PARAM G, W3 and W4; what looks wrong, and what is not read."""

from __future__ import annotations

from femtune.errors import Notice
from femtune.fem.structure import OverallDamping
from femtune.fem.values import FieldRef
from femtune.files.nastran.building import Building, FieldPlace
from femtune.files.nastran.control import real_param
from femtune.files.nastran.deck import Deck

_LARGEST_LOSS = 2.0
_MATRICES = ("B2PP",)


def overall_damping(building: Building) -> OverallDamping:
    """PARAM G as an entry of the value table, with W3 and W4 (error ``deck.param`` where they are below zero)."""
    w3, w4 = (_not_negative(building, name) for name in ("W3", "W4"))
    if "G" not in building.deck.params:
        return OverallDamping(None, w3, w4)
    ref, card = FieldRef("PARAM", 0, "G"), building.deck.params["G"].card
    cards = building.deck.cards
    # a PARAM of case control has no card that could be written
    if card.position < len(cards) and cards[card.position] is card:
        building.places[ref] = FieldPlace(card.position, (1,))
    return OverallDamping(building.values.add(ref, real_param(building, "G", 0.0)), w3, w4)


def _not_negative(building: Building, name: str) -> float:
    value = real_param(building, name, 0.0)
    if value < 0.0:
        with building.errors.catch():
            card = building.deck.params[name].card
            raise card.error("deck.param", f"PARAM {name} should be zero or more", index=1,
                             hint="give the frequency in rad/s, or remove the card")  # fmt: skip
    return max(value, 0.0)


def damping_notices(building: Building) -> list[Notice]:
    """Loss factors beyond all materials, and damping matrices that are not read."""
    return [*_large_losses(building), *_matrix_notices(building.deck)]


def _large_losses(building: Building) -> list[Notice]:
    table = building.values
    found = [(r, v) for r, v in zip(table.refs, table.values) if r in building.places and _is_loss(r) and _is_large(v)]
    if not found:
        return []
    ref, value = found[0]
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    what = f"the loss factor {ref} = {value:g}{more} is beyond any material: is it a percentage?"
    return [Notice("deck.large-loss-factor", what, building.deck.cards[building.places[ref].card].where())]


def _is_loss(ref: FieldRef) -> bool:
    return ref.name.startswith("GE") or ref == FieldRef("PARAM", 0, "G")


def _is_large(value: float) -> bool:
    return abs(value) > _LARGEST_LOSS


def _matrix_notices(deck: Deck) -> list[Notice]:
    return [
        Notice(
            "deck.damping-matrix", f"{c.name} = {c.value} adds damping that is not read; modes do not change", c.where
        )
        for c in deck.case_control.others
        if c.name in _MATRICES
    ]
