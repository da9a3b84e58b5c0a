"""Decks that have every card of the catalogue."""

from __future__ import annotations

from tests.files.nastran.card_samples import decks_of_samples
from tests.files.nastran.whole_decks import DECKS as WHOLE_DECKS

GENERAL = "GENEL,9000,,2,3\n,K,1000.\n"


def _held(text: str) -> str:
    """Bulk data with case control that requests modes of the structure, held at its first grid point."""
    head = "SOL 103\nCEND\nSPC = 9001\nMETHOD = 9001\nBEGIN BULK\nEIGRL,9001,,,3\nSPC1,9001,123456,1\n"
    return f"{head}{text}\nENDDATA\n"


def _decks() -> dict[str, dict[str, str]]:
    """Files of each deck by name: the whole decks, those of samples of cards, and one with a general element."""
    decks = dict(WHOLE_DECKS)
    decks |= {name: {"deck.bdf": _held(text)} for name, text in decks_of_samples(set()).items()}
    decks["general element"] = {"deck.bdf": WHOLE_DECKS["beams"]["deck.bdf"].replace("ENDDATA", GENERAL + "ENDDATA")}
    return decks


DECKS = _decks()
