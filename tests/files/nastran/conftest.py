"""Small decks written for one test, and the folder of real ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from femtune.files.nastran import Deck, read_deck


@pytest.fixture
def deck_of(tmp_path: Path) -> Callable[..., Deck]:
    """Reads a deck from texts: the main file's, and by name those of other files beside it."""

    def make(text: str, **others: str) -> Deck:
        for name, content in {"deck": text, **others}.items():
            path = tmp_path / f"{name}.bdf"
            path.write_bytes(content.encode("latin-1"))
        return read_deck(tmp_path / "deck.bdf")

    return make


@pytest.fixture(scope="session")
def nastran_decks(shared_data: Path) -> Path:
    """Folder of decks that other programs wrote."""
    return shared_data / "nastran_decks"
