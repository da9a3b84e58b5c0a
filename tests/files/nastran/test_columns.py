"""Decks that are read by whole columns are the same, and say the same, as decks that are read card by card."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, assembly, build_structure, columns, read_deck
from femtune.files.nastran.build import BuiltDeck
from femtune.files.nastran.columns import columns_of
from femtune.files.nastran.grids import plain_grids

from .mutations import mutant
from .whole_decks import DECKS

DeckOf = Callable[..., Deck]
MUTANTS, MORE, MANY = 10, 40, 100
ODD = (
    "",
    "1",
    "-1",
    "+1",
    "1 2",
    "1.",
    "1_0",
    ".",
    "-.5",
    "+.5",
    "1.5-3",
    "1.E3",
    "--1.",
    "1.-",
    "nan",
    "inf",
    "0x1",
    "9" * 8,
)


def outcome(path: Path) -> BuiltDeck | str:
    try:
        return build_structure(read_deck(path))
    except FemtuneError as error:
        return str(error)


def by_columns(path: Path, monkeypatch: pytest.MonkeyPatch) -> BuiltDeck | str:
    with monkeypatch.context() as patch:
        patch.setattr(columns, "FEWEST_CARDS", 1)
        return outcome(path)


def one_by_one(path: Path, monkeypatch: pytest.MonkeyPatch) -> BuiltDeck | str:
    with monkeypatch.context() as patch:
        patch.setattr(columns, "FEWEST_CARDS", 10**9)
        patch.setattr(assembly, "plain_name", lambda head: "")
        return outcome(path)


def check_same(one: BuiltDeck | str, other: BuiltDeck | str) -> None:
    if isinstance(one, str) or isinstance(other, str):
        assert one == other
        return
    assert [(c.name, c.fields, c.lines, c.format) for c in one.deck.cards] == [
        (c.name, c.fields, c.lines, c.format) for c in other.deck.cards
    ]
    assert one.notices == other.notices
    assert (one.fields, one.element_cards) == (other.fields, other.element_cards)
    a, b = one.structure, other.structure
    for name in ("ids", "xyz", "frames", "scalar_points"):
        np.testing.assert_array_equal(getattr(a.nodes, name), getattr(b.nodes, name))
    np.testing.assert_array_equal(a.permanent, b.permanent)
    assert {a.values.refs[i]: v for i, v in enumerate(a.values.values)} == {
        b.values.refs[i]: v for i, v in enumerate(b.values.values)
    }
    assert [x.kind for x in a.batches] == [x.kind for x in b.batches]
    for x, y in zip(a.batches, b.batches):
        np.testing.assert_array_equal(x.ids, y.ids)
        np.testing.assert_array_equal(x.dofs, y.dofs)
        for role in x.roles:
            assert [a.values.refs[i] for i in x.roles[role]] == [b.values.refs[i] for i in y.roles[role]]
        for fact in x.facts:
            np.testing.assert_array_equal(x.facts[fact], y.facts[fact])


def write(folder: Path, files: dict[str, bytes]) -> Path:
    for name, text in files.items():
        (folder / name).write_bytes(text)
    return folder / "deck.bdf"


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", DECKS)
def test_whole_decks(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, {n: text.encode("latin-1") for n, text in DECKS[name].items()})
    fast = by_columns(path, monkeypatch)
    assert isinstance(fast, BuiltDeck)
    check_same(fast, one_by_one(path, monkeypatch))


@pytest.mark.quick(0)
@pytest.mark.parametrize("name", DECKS)
def test_damaged_decks_say_the_same(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = {n: text.encode("latin-1") for n, text in DECKS[name].items()}
    for number in range(MUTANTS):
        path = write(tmp_path, mutant(files, number))
        check_same(by_columns(path, monkeypatch), one_by_one(path, monkeypatch))


@pytest.mark.slow
@pytest.mark.parametrize(
    "numbers", [range(MUTANTS, MORE), pytest.param(range(MORE, MANY), marks=pytest.mark.long)], ids=["more", "many"]
)
@pytest.mark.parametrize("name", DECKS)
def test_many_damaged_decks_say_the_same(
    name: str, numbers: range, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {n: text.encode("latin-1") for n, text in DECKS[name].items()}
    for number in numbers:
        path = write(tmp_path, mutant(files, number))
        check_same(by_columns(path, monkeypatch), one_by_one(path, monkeypatch))


@pytest.mark.slow
def test_reference_decks(nastran_decks: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("tet10.bdf", "trunc_cyl_shell.nas", "plate_py.dat", "bah_plane.bdf", "002_svanberg_beam/modes.dat"):
        check_same(by_columns(nastran_decks / name, monkeypatch), one_by_one(nastran_decks / name, monkeypatch))


@pytest.mark.parametrize("lines", ["GRID    {:<8}", "GRID    {:>8}", "GRID,{}", "GRID*   {:<16}"])
def test_what_is_a_number_is_what_a_card_says(deck_of: DeckOf, lines: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "FEWEST_CARDS", 1)
    cards = deck_of("\n".join(lines.format(text) for text in ODD) + "\n").cards
    found = columns_of(cards)
    assert found is not None
    (whole, whole_plain), (real, real_plain) = found.integers(0), found.reals(0)
    for i, card in enumerate(cards):
        assert found.blank(0)[i] == card.blank(0)
        if whole_plain[i]:
            assert whole[i] == card.integer(0)
        if real_plain[i]:
            assert real[i] == card.real(0, 0.0)
    spelled = {card.text(0) for i, card in enumerate(cards) if whole_plain[i]}
    assert spelled == {"1", "9" * 8}
    assert {card.text(0) for i, card in enumerate(cards) if real_plain[i]} == {
        "", "1.", "-.5", "+.5", "1.5-3", "1.E3",
    }  # fmt: skip


def test_long_fields_beside_short_ones(deck_of: DeckOf, monkeypatch: pytest.MonkeyPatch) -> None:
    """Large fields, an exponent, and a field that is longer than any; each row is the card's own."""
    monkeypatch.setattr(columns, "FEWEST_CARDS", 1)
    long = ("-5.000000000E-01", "1.23456789012-3", "12345678.9012345", "123456789012345", "1.5E+400")
    text = "".join(f"GRID*   {i + 1:<16}{'':16}{x:>16}\n*\n" for i, x in enumerate(long))
    cards = deck_of(f"GRID    9               .5\n{text}GRID,8,,1.000000000000000000000\n").by_name("GRID")
    found = columns_of(cards)
    assert found is not None
    assert found.integers(0)[0].tolist() == [9, 1, 2, 3, 4, 5, 8]
    values, plain = found.reals(2)
    assert plain.tolist() == [True, True, True, True, False, False, False]
    assert values[:4].tolist() == [0.5, -0.5, 1.23456789012e-3, 12345678.9012345]
    assert [found.blank(i).all() for i in (1, 2, 3)] == [True, False, True]


def test_grids_that_are_not_plain_are_read_one_by_one(deck_of: DeckOf, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "FEWEST_CARDS", 1)
    deck = deck_of("GRID,2,,1.,2.,3.\nGRID,1,,1.5-3,0.,0.\nGRID,3,,1.,0.,0.,5\nGRID,4,5,1.,0.,0.\nGRID,5,0,,,,0,12\n")
    found = plain_grids(deck.by_name("GRID"))
    assert found is not None
    assert list(found.records) == [1, 2, 3, 4, 5]
    assert found.simple.tolist() == [True, True, False, False, True]
    assert found.xyz[0].tolist() == [1.5e-3, 0.0, 0.0]
    assert found.supported.tolist() == [False] * 4 + [True]
    assert found.records[4].card is deck.by_name("GRID")[3]
    assert plain_grids(deck_of("GRID,1\nGRID,1\n").by_name("GRID")) is None
    assert plain_grids(deck_of("GRID,1\nGRID,1.\n").by_name("GRID")) is None


def test_lines_in_plain_columns_are_cut_when_they_are_asked_for(deck_of: DeckOf) -> None:
    deck = deck_of(
        "CHEXA   1       2       3       4       5       6       7       8       +\n+       9       10\nGRID,1\n"
    )
    hexa, grid = deck.cards
    assert hexa.plain
    assert hexa.given is None
    assert hexa.fields == tuple(map(str, range(1, 11)))
    assert hexa.given == hexa.fields
    assert not grid.plain
