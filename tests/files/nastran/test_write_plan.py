"""Updated values written back, in place and on copies for a part of the elements."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, read_deck, write_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.write import WritePlan, plan_edits

DeckOf = Callable[..., Deck]
TEXT = """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
$ steel
MAT1    1       2.+11           .25     7800.
PBAR    3       1       1.-3    2.-6    3.-6    4.-6     $ legs
PBEAM   4       1       1.      2.      3.                      $
                                                                $
        YES     1.      1.      2.      3.
                                                                $
PELAS,5,10.,,,6,20.
CBAR    1       3       1       2       0.      1.      0.
CBAR    2       3       1       2       0.      1.      0.
CBAR    3       3       1       2       0.      1.      0.
CBEAM   4       4       1       2       0.      1.      0.
CELAS1  5       6       1       1
CELAS1  6       6       1       2
CONROD  7       1       2       1       .5
CONM2   11      1               5.
"""


@pytest.fixture
def built(deck_of: DeckOf) -> BuiltDeck:
    return build_structure(deck_of(TEXT))


def again(plan: WritePlan, folder: Path) -> BuiltDeck:
    return build_structure(read_deck(write_deck(plan.edited, folder).main))


def value_of(model: BuiltDeck, element: int, role: str) -> float:
    batch = next(b for b in model.structure.batches if element in b.ids)
    i = batch.ids.tolist().index(element)
    return float(model.structure.values.values[batch.roles[role][i]])


def test_values_in_place(built: BuiltDeck, tmp_path: Path) -> None:
    updates = {
        FieldRef("PBAR", 3, "I1"): 2.123456789e-6,
        FieldRef("CONM2", 11, "M"): 5.5,
        FieldRef("PBEAM", 4, "A"): 1.25,
    }
    plan = plan_edits(built, updates)
    new = again(plan, tmp_path / "run")
    assert plan.splits == ()
    assert plan.values[FieldRef("PBAR", 3, "I1")] == pytest.approx(2.123456789e-6, rel=1e-4)
    for ref, written in plan.values.items():
        index = new.structure.values.index(ref)
        assert index is not None
        assert new.structure.values.values[index] == written
    changed = [
        (a, b) for a, b in zip(TEXT.splitlines(), (tmp_path / "run/updated.bdf").read_text().splitlines()) if a != b
    ]
    assert len(changed) == 4
    assert changed[0][1].endswith("$ legs")


def test_a_wide_card_holds_the_value_exactly(built: BuiltDeck, tmp_path: Path) -> None:
    ref = FieldRef("PBAR", 3, "I1")
    plan = plan_edits(built, {ref: 2.123456789e-6}, wide=True)
    assert plan.values[ref] == 2.123456789e-6
    assert value_of(again(plan, tmp_path / "run"), 1, "I1") == 2.123456789e-6


def test_property_split_for_some_elements(built: BuiltDeck, tmp_path: Path) -> None:
    ref = FieldRef("PBAR", 3, "I1", "top")
    plan = plan_edits(built, {ref: 7.5e-6, FieldRef("PBAR", 3, "I1"): 1.5e-6}, {"top": [2, 3]})
    assert [(s.source, s.copy, s.region, s.elements) for s in plan.splits] == [("PBAR 3", "PBAR 7", "top", (2, 3))]
    new = again(plan, tmp_path / "run")
    assert [value_of(new, e, "I1") for e in (1, 2, 3)] == [1.5e-6, 7.5e-6, 7.5e-6]
    assert [value_of(new, e, "I2") for e in (1, 2, 3)] == [3e-6] * 3
    assert plan.values == {ref: 7.5e-6, FieldRef("PBAR", 3, "I1"): 1.5e-6}


def test_material_split_copies_the_properties_too(built: BuiltDeck, tmp_path: Path) -> None:
    refs = {FieldRef("MAT1", 1, "E", "r"): 1.9e11, FieldRef("PBAR", 3, "A", "r"): 2e-3}
    plan = plan_edits(built, refs, {"r": [2, 4, 7]})
    assert {(s.source, s.elements) for s in plan.splits} == {
        ("MAT1 1", (2, 4, 7)), ("PBAR 3", (2,)), ("PBEAM 4", (4,)),
    }  # fmt: skip
    new = again(plan, tmp_path / "run")
    assert [value_of(new, e, "E") for e in (1, 2, 3, 4, 7)] == [2e11, 1.9e11, 2e11, 1.9e11, 1.9e11]
    assert [value_of(new, e, "G") for e in (1, 2)] == pytest.approx([2e11 / 2.5, 1.9e11 / 2.5])
    assert [value_of(new, e, "A") for e in (1, 2, 3, 4, 7)] == [1e-3, 2e-3, 1e-3, 1.0, 0.5]


def test_split_deck_is_the_split_structure(built: BuiltDeck, tmp_path: Path) -> None:
    ref = FieldRef("MAT1", 1, "E")
    index = built.structure.values.index(ref)
    assert index is not None
    split = built.structure.split(index, [2, 4, 7], "r")
    position = split.values.index(FieldRef("MAT1", 1, "E", "r"))
    assert position is not None
    split.values.values[position] = 1.9e11
    new = again(plan_edits(built, {FieldRef("MAT1", 1, "E", "r"): 1.9e11}, {"r": [2, 4, 7]}), tmp_path / "run")
    for old, other in zip(split.batches, new.structure.batches):
        for role in set(old.roles) - {"G"}:
            np.testing.assert_array_equal(
                split.values.values[old.roles[role]], new.structure.values.values[other.roles[role]]
            )  # fmt: skip


def test_one_of_two_properties_on_a_card(built: BuiltDeck, tmp_path: Path) -> None:
    plan = plan_edits(built, {FieldRef("PELAS", 6, "K", "r"): 25.0}, {"r": [6]})
    new = again(plan, tmp_path / "run")
    assert [value_of(new, e, "K") for e in (5, 6)] == [20.0, 25.0]


def test_overlapping_regions_and_a_change_of_the_whole_card(built: BuiltDeck, tmp_path: Path) -> None:
    refs = {
        FieldRef("PBAR", 3, "J"): 9e-6,
        FieldRef("PBAR", 3, "I1", "a"): 7e-6,
        FieldRef("PBAR", 3, "I2", "b"): 8e-6,
        FieldRef("MAT1", 1, "E", "c"): 1.9e11,
    }
    plan = plan_edits(built, refs, {"a": [1, 2], "b": [2, 3], "c": [3]})
    new = again(plan, tmp_path / "run")
    assert [value_of(new, e, "I1") for e in (1, 2, 3)] == [7e-6, 7e-6, 2e-6]
    assert [value_of(new, e, "I2") for e in (1, 2, 3)] == [3e-6, 8e-6, 8e-6]
    assert [value_of(new, e, "E") for e in (1, 2, 3)] == [2e11, 2e11, 1.9e11]
    assert [value_of(new, e, "J") for e in (1, 2, 3)] == [9e-6] * 3
    assert plan.values == refs


def test_an_element_of_its_own_needs_no_copy(built: BuiltDeck, tmp_path: Path) -> None:
    plan = plan_edits(built, {FieldRef("CONROD", 7, "A", "r"): 0.75}, {"r": [7]})
    assert plan.splits == ()
    assert value_of(again(plan, tmp_path / "run"), 7, "A") == 0.75


@pytest.mark.parametrize(
    ("ref", "regions", "code"),
    [
        (FieldRef("MAT1", 1, "G"), {}, "write.no-field"),
        (FieldRef("MAT1", 1, "G", "r"), {"r": [2]}, "write.no-field"),
        (FieldRef("PBAR", 3, "A", "r"), {}, "write.unknown-region"),
        (FieldRef("PBAR", 3, "A", "r"), {"r": [99]}, "write.unknown-region"),
        (FieldRef("PBAR", 3, "A", "r"), {"r": [4]}, "write.unknown-region"),
    ],
)
def test_errors(built: BuiltDeck, ref: FieldRef, regions: dict[str, list[int]], code: str) -> None:
    with pytest.raises(FemtuneError) as error:
        plan_edits(built, {ref: 1.0}, regions)
    assert error.value.code == code
