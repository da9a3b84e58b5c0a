"""What a deck says of superelements: parts and those of other runs are refused, others are solved as one model."""

from __future__ import annotations

from femtune.errors import FemtuneError, Notice, Where
from femtune.files.nastran.deck import Deck

_IN_ONE_MODEL = ("SESET", "SETREE", "SEELT", "SEQSET", "SEQSET1", "CSUPEXT", "RELEASE")
_IN_PARTS = ("SECONCT", "SEBNDRY", "SELOC", "SEMPLN")
_EXTERNAL = ("EXTERNAL", "EXTOP2", "EXTOP4", "MATRIX", "MATDB", "MATOP4")


def check_superelements(deck: Deck) -> list[Notice]:
    """A notice where the deck divides its one model.

    Raises
    ------
    FemtuneError : ``deck.superelement`` for parts, and for superelements of other runs
    """
    external = next((c for c in deck.by_name("SEBULK") if c.text(1).startswith(_EXTERNAL)), None)
    if external is not None:
        raise FemtuneError("deck.superelement/external", where=external.where(), card=external.record)
    if deck.parts:
        number, line = next(iter(deck.parts.items()))
        count = f"{len(deck.parts)} superelement{'s' if len(deck.parts) > 1 else ''}"
        where = Where(line.file, line.number, f"BEGIN SUPER {number}")
        raise FemtuneError("deck.superelement", where=where, count=count, number=number)
    missing = next(iter(deck.by_name("SEBULK")), None)
    if missing is not None:
        raise FemtuneError("deck.superelement/no-part", where=missing.where(), card=missing.record)
    joined = next((deck.by_name(name)[0] for name in _IN_PARTS if deck.by_name(name)), None)
    if joined is not None:
        raise FemtuneError("deck.superelement/external", where=joined.where(), card=joined.record)
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
