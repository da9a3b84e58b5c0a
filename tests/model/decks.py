"""Small decks as texts, read and built."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path

from femtune.fem import Structure
from femtune.files.nastran import format_real, read_deck
from femtune.files.nastran.build import build_structure

Field = float | int | str | None


def card(name: str, *fields: Field) -> str:
    """A card in large field, so that values keep their digits."""
    texts = [_text(f).ljust(16) for f in fields]
    rows = [texts[i : i + 4] for i in range(0, len(texts), 4)]
    return "\n".join(f"{name + '*' if i == 0 else '*':8}" + "".join(row) for i, row in enumerate(rows))


def _text(field: Field) -> str:
    if field is None:
        return ""
    return format_real(field, 16) if isinstance(field, float) else str(field)


def deck(cards: Iterable[str], case: str = "") -> str:
    """A whole deck around bulk cards."""
    return "\n".join(["SOL 103", "CEND", *([case] if case else []), "BEGIN BULK", *cards, "ENDDATA", ""])


def structure_of(text: str) -> Structure:
    """The structure that a deck describes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.bdf"
        path.write_text(text)
        return build_structure(read_deck(path)).structure
