"""Damping that was updated, written back: bytes change in the fields of the values only."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, read_deck, write_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.write import WritePlan, plan_edits

DeckOf = Callable[..., Deck]
TEXT = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
SPOINT,50,51
MAT1*   1               2.+11                           .25
*       7800.                                           .02             keep
CONROD  7       1       2       1       .5
PELAS   5       10.     .1              6       20.
CELAS1  11      5       1       1
CELAS1  12      6       2       1
CELAS1  13      6       2       2
CELAS2,14,3.,1,1,,,.25,   $ own
CELAS4,15,3.,50
PDAMP   1       1.      2       2.      3       3.
CDAMP1  21      3       1       1
CDAMP3  22      2       50      51
CDAMP1  23      2       1       2
CDAMP2* 24              .5              1               1
CDAMP4,25,.75,51
PVISC,4,.1,.2,,5,.3,.4
CVISC,31,5,1,2
PBUSH1D,9,7.,.3
CBUSH1D,41,9,1,2
CMASS4,42,3.,50
PBUSH   1       K       1.      2.      3.
                B       .1      .2                                      $ end
                GE      .01     .02
CBUSH   51      1       1       2                               0
CBUSH   52      1       1       2                               0
PBUSH   2       K       1.      2.      3.
CBUSH   53      2       1       2                               0
"""
FIELDS = {
    "MAT1 1 GE": 0.02, "PELAS 5 GE": 0.1, "PELAS 6 GE": 0.0, "CELAS2 14 GE": 0.25, "CELAS4 15 K": 3.0,
    "PDAMP 2 B": 2.0, "PDAMP 3 B": 3.0, "CDAMP2 24 B": 0.5, "CDAMP4 25 B": 0.75, "PVISC 5 CE": 0.3, "PVISC 5 CR": 0.4,
    "PBUSH1D 9 K": 7.0, "PBUSH1D 9 C": 0.3, "CMASS4 42 M": 3.0, "PBUSH 1 B2": 0.2, "PBUSH 1 B6": 0.0,
    "PBUSH 1 GE1": 0.01, "PBUSH 1 GE5": 0.0, "PBUSH 2 GE1": 0.0, "PBUSH 2 B3": 0.0,
}  # fmt: skip


@pytest.fixture
def built(deck_of: DeckOf) -> BuiltDeck:
    return build_structure(deck_of(TEXT))


def again(plan: WritePlan, folder: Path) -> BuiltDeck:
    return build_structure(read_deck(write_deck(plan.edited, folder).main))


def value(model: BuiltDeck, ref: FieldRef) -> float:
    return float(model.structure.values.values[resolve(model, ref)])


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines()


@pytest.mark.quick(6)
@pytest.mark.parametrize("text", FIELDS)
def test_every_value_in_its_field(built: BuiltDeck, text: str, tmp_path: Path) -> None:
    ref = parse_field_ref(text)
    assert value(built, ref) == FIELDS[text]
    plan = plan_edits(built, {ref: 0.125})
    model = again(plan, tmp_path / "new")
    assert value(model, ref) == 0.125
    before, after = TEXT.splitlines(), lines(tmp_path / "new" / "updated.bdf")
    changed = [(a, b) for a, b in zip(before, after) if a != b]
    if text in ("PBUSH 2 GE1", "PBUSH 2 B3"):
        # the card has no such line; the rest of the file stays
        assert [line for line in after if line in before] == before
    else:
        assert (len(changed), len(after)) == (1, len(before))
        old, new = changed[0]
        assert ("0.125" in new) or (".125" in new)
        assert old.split("$")[1:] == new.split("$")[1:]
        assert ("keep" in old) == ("keep" in new)


def test_two_lines_that_a_bush_lacks(built: BuiltDeck, tmp_path: Path) -> None:
    updates = {FieldRef("PBUSH", 2, "GE1"): 0.05, FieldRef("PBUSH", 2, "B1"): 0.5}
    model = again(plan_edits(built, updates), tmp_path / "new")
    assert [value(model, ref) for ref in updates] == [0.05, 0.5]
    assert value(model, FieldRef("PBUSH", 2, "K2")) == 2.0


@pytest.mark.parametrize(
    ("text", "element"),
    [("PDAMP 2 B", 22), ("PELAS 6 GE", 12), ("PBUSH 1 GE2", 51), ("PBUSH 1 B4", 52), ("MAT1 1 GE", 7)],
)
def test_a_part_of_the_elements_gets_a_copy_of_the_card(
    built: BuiltDeck, text: str, element: int, tmp_path: Path
) -> None:
    ref = parse_field_ref(text)
    there = FieldRef(ref.card, ref.id, ref.name, "part")
    plan = plan_edits(built, {there: 0.125}, {"part": [element]})
    model = again(plan, tmp_path / "new")
    if text != "MAT1 1 GE":  # no other element uses that material
        assert value(model, ref) == value(built, ref)
    batch = next(b for b in model.structure.batches if element in b.ids)
    role = ref.name if ref.name in batch.roles else "GE"
    i = batch.ids.tolist().index(element)
    assert model.structure.values.values[batch.roles[role][i]] == 0.125


def test_a_copy_of_a_bush_without_the_line_has_its_flag(built: BuiltDeck, tmp_path: Path) -> None:
    ref = FieldRef("PBUSH", 2, "GE1", "part")
    model = again(plan_edits(built, {ref: 0.125}, {"part": [53]}), tmp_path / "new")
    batch = next(b for b in model.structure.batches if 53 in b.ids)
    found = {r: float(model.structure.values.values[at[batch.ids.tolist().index(53)]]) for r, at in batch.roles.items()}
    assert (found["GE1"], found["GE6"], found["K2"]) == (0.125, 0.125, 2.0)


@pytest.mark.parametrize(
    "card",
    [
        "PBUSH   2       K       1.      2.      3.\n", "PBUSH,2,K,1.,2.,3.\n",
        "PBUSH,2,K,1.,2.,3.,4.,5.,6.,+X\n+X,,RCV,1.\n",
        "PBUSH*  2               K               1.              2.\n*       3.\n",
        "PBUSH*  2               K               1.              2.\n",
    ],
)  # fmt: skip
@pytest.mark.parametrize("names", [("GE1",), ("B2",), ("B2", "GE1"), ("GE1", "B6", "B2")])
def test_new_lines_in_every_format(deck_of: DeckOf, card: str, names: tuple[str, ...], tmp_path: Path) -> None:
    """A line of its own for each flag, right behind the card, and no blank one between."""
    head, tail = "GRID,1,,0.,0.,0.\nCBUSH,53,2,1,,,,,0\n", "GRID,2,,0.,0.,0.\n"
    built = build_structure(deck_of(head + card + tail))
    plan = plan_edits(built, {FieldRef("PBUSH", 2, name): 0.125 for name in names})
    model = again(plan, tmp_path / "new")
    values = {str(ref): float(v) for ref, v in zip(model.structure.values.refs, model.structure.values.values)}
    assert all(values[f"PBUSH 2 {name}"] == 0.125 for name in names)
    assert (values["PBUSH 2 K1"], values["PBUSH 2 K2"]) == (1.0, 2.0)
    text = (tmp_path / "new" / "updated.bdf").read_text()
    assert text.startswith(head + card)
    assert text.endswith(tail)
    (found,) = read_deck(tmp_path / "new" / "updated.bdf").by_name("PBUSH")
    flags = [found.text(at) for at in range(1, len(found.fields), 8)]
    assert len(flags) == len(set(flags))
    assert all(flags)


def test_the_report_of_writing_knows_each_field(built: BuiltDeck) -> None:
    refs = {FieldRef("PBUSH", 2, "B1"): 0.5, FieldRef("PBUSH", 2, "GE1"): 0.05}
    plan = plan_edits(built, refs)
    named = {plan.places[c.position, c.index] for c in plan.edited.changes if (c.position, c.index) in plan.places}
    assert named == set(refs)
