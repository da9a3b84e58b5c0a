"""Fields edited in place: only their bytes change; new cards; large field; decks in a run folder."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, NewCard, edit_fields, read_deck, rounded, write_deck
from femtune.files.nastran.edit import EditedDeck

DeckOf = Callable[..., Deck]
SMALL = "MAT1           1   2.1+5              .3  7.85-9$ steel\n"


def _text(edited: EditedDeck) -> str:
    (text,) = edited.texts.values()
    return text


def _changed_lines(before: str, after: str) -> list[str]:
    lines = difflib.ndiff(before.splitlines(keepends=True), after.splitlines(keepends=True))
    return [line for line in lines if line[0] in "+-"]


@pytest.mark.parametrize(
    ("before", "index", "value", "after"),
    [
        (SMALL, 1, 2.05e5, "MAT1           1205000.0              .3  7.85-9$ steel\n"),
        (SMALL, 2, 8.1e4, "MAT1           1   2.1+5 81000.0      .3  7.85-9$ steel\n"),
        (SMALL, 5, 1.5, "MAT1           1   2.1+5              .3  7.85-9     1.5$ steel\n"),
        ("MAT1    1       2.1+5           .3\r\n", 1, 1.5, "MAT1    1       1.5             .3\r\n"),
        ("MAT1    1       2.1+5           .3\r\n", 3, 0.25, "MAT1    1       2.1+5           0.25\r\n"),
        ("MAT1    1       2.1+5           .3", 3, -0.123456789, "MAT1    1       2.1+5           -.123457"),
        ("MAT1\t1\t2.1+5\t\t.3\n", 1, 1.5, "MAT1\t1\t1.5     \t.3\n"),
        ("MAT1,1, 2.1+5 ,,.3 $ x\n", 1, 1.5, "MAT1,1, 1.5 ,,.3 $ x\n"),
        ("MAT1,1,2.1+5,,.3 $ x\n", 5, 1.5, "MAT1,1,2.1+5,,.3,,1.5 $ x\n"),
        ("MAT1,1,2.1+5,,.3\n", 2, 1.5, "MAT1,1,2.1+5,1.5,.3\n"),
        ("MAT1,1,210000.0001\n", 1, 1 / 3, "MAT1,1,.3333333333\n"),
        ("MAT1,1,2.1+5\n", 1, 1 / 3, "MAT1,1,.3333333\n"),
        ("MAT1*                  1           2.1+5\n*\n", 1, 1 / 3,
         "MAT1*                  1.333333333333333\n*\n"),
        ("MAT1*                  1           2.1+5\n*\n", 4, 1.5,
         "MAT1*                  1           2.1+5\n*                    1.5\n"),
        ("PBAR,1,2\n", 9, 1.5, "PBAR,1,2\n+,,1.5\n"),
        ("PBAR,1,2\n", 17, 1.5, "PBAR,1,2\n+\n+,,1.5\n"),
        ("PBAR           1       2\r\n$ next\r\n", 8, 1.5,
         "PBAR           1       2\r\n+            1.5\r\n$ next\r\n"),
        ("PBAR*                  1               2\n*\n", 8, 1.5,
         "PBAR*                  1               2\n*\n*                    1.5\n*\n"),
        ("PBAR,1,2", 8, 1.5, "PBAR,1,2\n+,1.5"),
    ],
)  # fmt: skip
def test_one_field_changes(deck_of: DeckOf, before: str, index: int, value: float, after: str) -> None:
    edited = edit_fields(deck_of(before), {(0, index): value})
    assert _text(edited) == after
    assert edited.values == {(0, index): pytest.approx(value, rel=1e-5)}


def test_a_field_that_has_the_value_is_not_touched(deck_of: DeckOf) -> None:
    edited = edit_fields(deck_of(SMALL), {(0, 1): 2.1e5, (0, 0): 1})
    assert edited.texts == {}
    assert edited.values == {(0, 1): 2.1e5}


def test_integer_and_word(deck_of: DeckOf) -> None:
    edited = edit_fields(deck_of("CBAR           1       7       1       2\n"), {(0, 1): 1234, (0, 4): "BGG"})
    assert _text(edited) == "CBAR           1    1234       1       2     BGG\n"
    assert [(change.before, change.after) for change in edited.changes] == [("7", "1234"), ("", "BGG")]


def test_wide_rewrites_the_card_in_large_field_with_its_comments(deck_of: DeckOf) -> None:
    before = "$ a\nPBAR           1       2      3.      4.$ b\n$ c\n+            5.\n$ d\nGRID,1\n"
    deck = deck_of(before)
    edited = edit_fields(deck, {(0, 2): 1 / 3}, wide=True)
    lines = _text(edited).split("\n")
    assert [line for line in lines if line.startswith("$")] == ["$ a", "$ c", "$ d"]
    assert lines[1].endswith("$ b")
    assert lines[1][:72] == "PBAR*                  1               2.333333333333333              4."
    assert lines[2] == "*"
    assert lines[4:6] == ["*                     5.", "*"]
    assert edited.values == {(0, 2): rounded(1 / 3, 16)}


def test_wide_leaves_a_card_whose_field_holds_the_value(deck_of: DeckOf) -> None:
    assert _text(edit_fields(deck_of("MAT1,1,2.\n"), {(0, 1): 2.5}, wide=True)) == "MAT1,1,2.5\n"


@pytest.mark.parametrize(
    ("text", "after"),
    [
        (
            "PBAR           1       2      3.\nGRID,1\n",
            "PBAR           1       2      3.\nPBAR           9       2     2.5      xy\nGRID,1\n",
        ),
        ("PBAR,1,2,3.", "PBAR,1,2,3.\nPBAR,9,2,2.5,xy"),
        ("PBAR*,1,2,3.\n", "PBAR*,1,2,3.\nPBAR*,9,2,2.5,xy\n*\n"),
    ],
)
def test_new_card_follows_in_the_same_format(deck_of: DeckOf, text: str, after: str) -> None:
    edited = edit_fields(deck_of(text), {}, new_cards=[NewCard(0, "PBAR", (9, "2", 2.5, "xy"))])
    assert _text(edited) == after


def test_new_cards_keep_their_order_and_the_edit_above(deck_of: DeckOf) -> None:
    new = [NewCard(0, "PBAR", (9, 2)), NewCard(0, "PBAR", (10, 2))]
    edited = edit_fields(deck_of("PBAR,1,2,3.\n"), {(0, 2): 4.0}, new_cards=new)
    assert _text(edited) == "PBAR,1,2,4.0\nPBAR,9,2\nPBAR,10,2\n"


def test_new_card_with_continuation_is_read_back(deck_of: DeckOf, tmp_path: Path) -> None:
    fields = (9, 2, *(float(i) / 7 for i in range(15)))
    for text in ("PBAR           1       2\n", "PBAR,1\n", "PBAR*                  1\n*\n"):
        edited = edit_fields(deck_of(text), {}, new_cards=[NewCard(0, "PBAR", fields)])
        card = read_deck(write_deck(edited, tmp_path / "run").main).cards[1]
        assert card.integer(0) == 9
        assert [card.real(i + 2) for i in range(15)] == pytest.approx([i / 7 for i in range(15)], abs=1e-6)


CARDS = st.lists(
    st.one_of(st.just(""), st.integers(0, 999).map(str), st.floats(-1e6, 1e6).map(lambda v: f"{v:.3e}"[:8])),
    min_size=1,
    max_size=20,
)


def _small(fields: list[str]) -> str:
    rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
    heads = ["PBAR", *["+"] * len(rows)]
    return "".join(h.ljust(8) + "".join(f.rjust(8) for f in row) + " $ c\n$ d\n" for h, row in zip(heads, rows))


def _free(fields: list[str]) -> str:
    rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
    return "".join(h + "," + ",".join(row) + "\n" for h, row in zip(["PBAR", *[""] * len(rows)], rows))


@pytest.mark.quick(0)
@pytest.mark.parametrize("layout", [_small, _free])
@pytest.mark.parametrize("wide", [False, True])
@given(fields=CARDS, index=st.integers(0, 25), value=st.floats(-1e9, 1e9))
def test_any_field_of_any_card(
    deck_of: DeckOf,
    tmp_path: Path,
    layout: Callable[[list[str]], str],
    wide: bool,
    fields: list[str],
    index: int,
    value: float,
) -> None:
    deck = deck_of("GRID,1\n" + layout(["77", *fields]) + "GRID,2\n")
    edited = edit_fields(deck, {(1, index): value}, wide=wide)
    again = read_deck(write_deck(edited, tmp_path / "run").main)
    assert [card.name for card in again.cards] == ["GRID", "PBAR", "GRID"]
    wanted = [deck.cards[1].text(i) for i in range(30)]
    found = [again.cards[1].text(i) for i in range(30)]
    assert found[:index] + found[index + 1 :] == wanted[:index] + wanted[index + 1 :]
    assert again.cards[1].real(index) == edited.values[1, index]
    assert edited.values[1, index] == pytest.approx(value, rel=1e-3, abs=1e-9)


def _common(one: str, other: str) -> int:
    return next((i for i, (a, b) in enumerate(zip(one, other)) if a != b), min(len(one), len(other)))


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    ("name", "card", "number", "index", "value"),
    [
        ("satk.dat", "CONM2", 0, 3, 0.123456789),
        ("002_svanberg_beam/modes.dat", "PBEAM", 2, 3, 1234.5678),
        ("004_72_bar_truss/modes.dat", "PROD", 5, 2, 0.4321),
        ("cbush.dat", "PBUSH", 0, 2, 1.2345e7),
        ("beam_modes.dat", "CONM2", 0, 9, 1.5e-3),
        ("pt145.bdf", "CMASS2", 3, 1, 1.1e-5),
        ("solid_shell_bar/mode_solid_shell_bar.bdf", "MAT1", 0, 1, 2.8e7),
        ("trunc_cyl_shell.nas", "GRID", 400, 2, 1 / 3),
    ],
)
def test_one_field_of_a_real_deck(
    nastran_decks: Path, tmp_path: Path, name: str, card: str, number: int, index: int, value: float
) -> None:
    deck = read_deck(nastran_decks / name)
    chosen = deck.by_name(card)[number]
    edited = edit_fields(deck, {(chosen.position, index): value})
    (file,) = [file for file in deck.files if file.file in edited.texts]
    changed = _changed_lines(file.text, _text(edited))
    assert [line[0] for line in changed] == ["-", "+"]
    before, after = (line[2:] for line in changed)
    same = _common(before, after) + _common(before[::-1], after[::-1])
    assert len(before) - same <= 16
    again = read_deck(write_deck(edited, tmp_path / "run").main)
    expected = [list(one.fields) for one in deck.cards]
    expected[chosen.position][index] = edited.changes[0].after
    assert [list(one.fields) for one in again.cards] == expected
    assert again.cards[chosen.position].real(index) == pytest.approx(value, rel=1e-4)


def test_changed_include_goes_beside_the_deck_and_others_stay(deck_of: DeckOf, tmp_path: Path) -> None:
    deck = deck_of("$ x\nINCLUDE 'a.bdf' $ one\ninclude b.bdf\nGRID,1\n", a="MAT1,1,2.\n", b="GRID,2\n")
    written = write_deck(edit_fields(deck, {(0, 1): 3.0}), tmp_path / "runs" / "first")
    assert [path.name for path in written.files] == ["updated.bdf", "a.bdf"]
    assert written.main.read_text() == "$ x\nINCLUDE 'a.bdf' $ one\ninclude '../../b.bdf'\nGRID,1\n"
    assert (written.main.parent / "a.bdf").read_text() == "MAT1,1,3.0\n"
    assert [(change.before, change.after, change.where.line) for change in written.include_changes] == [
        ("b.bdf", "../../b.bdf", 3)
    ]
    assert read_deck(written.main).cards[0].real(1) == 3.0


def test_an_include_inside_an_include_pulls_its_parent_along(deck_of: DeckOf, tmp_path: Path) -> None:
    deck = deck_of("INCLUDE 'a.bdf'\n", a="GRID,1\nINCLUDE 'b.bdf'\n", b="MAT1,1,2.\n")
    written = write_deck(edit_fields(deck, {(1, 1): 3.0}), tmp_path / "run")
    assert [path.name for path in written.files] == ["updated.bdf", "a.bdf", "b.bdf"]
    assert read_deck(written.main).cards[1].real(1) == 3.0


def test_includes_of_one_name_in_two_folders(tmp_path: Path) -> None:
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "p.bdf").write_text(f"MAT1,{1 + (folder == 'y')},2.\n")
    (tmp_path / "deck.bdf").write_text("INCLUDE 'x/p.bdf'\nINCLUDE 'y/\n  p.bdf'\nGRID,1\n")
    deck = read_deck(tmp_path / "deck.bdf")
    written = write_deck(edit_fields(deck, {(0, 1): 3.0, (1, 1): 4.0}), tmp_path / "run")
    assert [path.name for path in written.files] == ["updated.bdf", "p.bdf", "p_2.bdf"]
    assert written.main.read_text() == "INCLUDE 'p.bdf'\nINCLUDE 'p_2.bdf'\nGRID,1\n"
    assert [card.text(1) for card in read_deck(written.main).cards[:2]] == ["3.0", "4.0"]


def test_a_long_path_is_cut_before_column_72(tmp_path: Path) -> None:
    far = tmp_path / ("a" * 40) / ("b" * 40) / "caf\u00e9"
    far.mkdir(parents=True)
    (far / "p.bdf").write_text("GRID,7\n")
    (far / "deck.bdf").write_text("INCLUDE 'p.bdf'\n")
    written = write_deck(edit_fields(read_deck(far / "deck.bdf"), {}), tmp_path / "run")
    assert max(map(len, written.main.read_text().splitlines())) <= 72
    assert read_deck(written.main).cards[0].integer(0) == 7


@pytest.mark.parametrize(
    ("text", "edits", "code"),
    [
        ("GRID,1,,0.\n=,*(1),,*(1.),==\n", {(0, 2): 1.0}, "write.replicated"),
        ("GRID,1,,0.\n=,*(1),,*(1.),==\n", {(1, 2): 1.0}, "write.replicated"),
        ("CBAR,1,2\n", {(0, 1): 123456789}, "write.too-wide"),
        ("MAT1,1,2.\n", {(0, 1): float("nan")}, "write.not-finite"),
        ("INCLUDE 'p.bdf'\nINCLUDE 'p.bdf'\n", {(0, 1): 1.0}, "write.included-twice"),
        ("PBAR*   1               2\n+       1.      2.\n", {(0, 5): 1.0}, "write.not-read-back"),
    ],
)
def test_edits_that_are_refused(deck_of: DeckOf, text: str, edits: dict[tuple[int, int], float], code: str) -> None:
    deck = deck_of(text, p="MAT1,1,2.\n")
    with pytest.raises(FemtuneError) as caught:
        edit_fields(deck, edits)
    assert caught.value.code == code
    assert caught.value.where is not None
    assert caught.value.where.line in (1, 2)


def test_the_deck_that_was_read_is_not_overwritten(deck_of: DeckOf, tmp_path: Path) -> None:
    deck = deck_of("MAT1,1,2.\n")
    with pytest.raises(FemtuneError) as caught:
        write_deck(edit_fields(deck, {(0, 1): 3.0}), tmp_path, "deck.bdf")
    assert caught.value.code == "write.overwrites-input"
    assert (tmp_path / "deck.bdf").read_text() == "MAT1,1,2.\n"


def test_unwritable_folder(deck_of: DeckOf, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(FemtuneError) as caught:
        write_deck(edit_fields(deck_of("GRID,1\n"), {}), tmp_path / "file" / "run")
    assert caught.value.code == "run.unwritable"
