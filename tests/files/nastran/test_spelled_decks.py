"""What is read from a deck is what its generator wrote, however the numbers and the cards are spelled."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.files.nastran import build_structure, read_deck

from .spelled_decks import spelled_deck

QUICK, ALL = 20, 500


def check(number: int, folder: Path) -> None:
    """Read the deck of a number, and compare all of its values."""
    deck = spelled_deck(number)
    path = folder / "deck.bdf"
    path.write_text(deck.text)
    built = build_structure(read_deck(path))
    table = built.structure.values
    found = {str(ref): float(table.values[table.index(ref)]) for ref in built.fields}
    assert {name: found.get(name) for name in deck.values} == deck.values, deck.text
    nodes = built.structure.nodes
    assert {int(n): tuple(x) for n, x in zip(nodes.ids, nodes.xyz.tolist())} == deck.places, deck.text


@pytest.mark.parametrize("count", [QUICK, pytest.param(ALL, marks=pytest.mark.slow)])
def test_values_are_those_of_the_generator(count: int, tmp_path: Path) -> None:
    for number in range(count):
        check(number, tmp_path)


def test_decks_are_spelled_in_many_ways() -> None:
    texts = [spelled_deck(number).text for number in range(60)]
    assert len(set(texts)) == 60
    assert all(any(sign in text for text in texts) for sign in ("GRID*", "GRID,", "GRID ", "D+", "E-", "grid"))
