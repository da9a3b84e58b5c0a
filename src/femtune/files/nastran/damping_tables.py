"""Modal damping over frequency: TABDMP1, and which table case control selects."""

from __future__ import annotations

from collections.abc import Mapping

from femtune.errors import FemtuneError
from femtune.files.nastran.building import Building
from femtune.files.nastran.card import Card
from femtune.files.nastran.control import check_selected, real_param
from femtune.files.nastran.record import Record
from femtune.model.damping import DampingUnit, ModalDamping, as_hysteretic, damping_table

_UNITS: Mapping[str, DampingUnit] = {"G": "G", "CRIT": "CRIT", "Q": "Q"}
_FIRST_PAIR = 8


def damping_tables(building: Building) -> dict[int, ModalDamping]:
    """Tables of modal damping by number."""
    tables = {}
    for number, record in building.by_number(building.records("TABDMP1"), "table").items():
        with building.errors.catch():
            tables[number] = _table(record)
    return tables


def modal_damping(building: Building, tables: Mapping[int, ModalDamping]) -> ModalDamping | None:
    """The table that SDAMPING selects, as PARAM KDAMP has it taken; None without one (error ``deck.missing-set``)."""
    selected = building.deck.case_control.damping
    # a table that cannot be used has its own error
    known = {card.integer(0, 0) for card in building.deck.by_name("TABDMP1") if card.is_integer(0)}
    check_selected(building, "SDAMPING", selected, known)
    if selected is None or selected not in tables:
        return None
    found = tables[selected]
    return as_hysteretic(found) if real_param(building, "KDAMP", 1.0) < 0.0 else found


def _table(record: Record) -> ModalDamping:
    unit = record.text("TYPE", "G")
    if unit not in _UNITS:
        raise record.error("deck.damping-table", f"'{unit}' is no type of damping", at="TYPE",
                           hint="known: G (loss factor), CRIT (damping ratio), Q (quality)")  # fmt: skip
    pairs = _pairs(record.card)
    try:
        return damping_table([x for x, _ in pairs], [y for _, y in pairs], _UNITS[unit], record.integer("FLAT", 0) == 1)
    except FemtuneError as error:
        raise record.error("deck.damping-table", error.what, hint=error.hint) from error


def _pairs(card: Card) -> list[tuple[float, float]]:
    """Frequencies and values up to ENDT; a pair with SKIP is left out, and one that is blank."""
    found: list[tuple[float, float]] = []
    for at in range(_FIRST_PAIR, len(card.fields), 2):
        texts = (card.text(at), card.text(at + 1))
        if "ENDT" in texts:
            return found
        if "SKIP" not in texts and any(texts):
            found.append((card.real(at), card.real(at + 1)))
    raise card.error("deck.damping-table", "the table has no ENDT: is it complete?",
                     hint="write ENDT behind the last pair")  # fmt: skip
