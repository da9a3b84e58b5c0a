"""Regions of parameters: by number, property, material, set of the deck, box and nearness, and fields of all cards."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.study.study import Study, load_study

DECK = """SOL 103
CEND
SET 7 = 1 THRU 3, 99
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,2.,0.,0.
GRID,4,,3.,0.,0.
GRID,5,,4.,0.,0.
GRID,6,,4.,0.,.1
MAT1,1,2.1+11,,.3,7850.
MAT1,2,7.+10,,.3,2700.
PBAR,1,1,1.-3,2.-7,5.-7,4.-7
PBAR,2,2,1.-3,2.-7,5.-7,4.-7
CBAR,1,1,1,2,0.,1.,0.
CBAR,2,1,2,3,0.,1.,0.
CBAR,3,2,3,4,0.,1.,0.
CBAR,4,2,4,5,0.,1.,0.
RBE2,20,5,123456,6
CONM2,9,5,,2.
ENDDATA
"""

STUDY = """[study]
title = "regions"
deck = "beam.bdf"
units = "m-kg-s"

[[parameter]]
name = "p"
fields = {fields}
lower = 0.5
upper = 2.0
region = {{ {region} }}
"""


def study(folder: Path, region: str, fields: str = '["MAT1 E"]') -> Study:
    (folder / "beam.bdf").write_text(DECK)
    (folder / "study.toml").write_text(STUDY.format(region=region, fields=fields))
    return load_study(folder / "study.toml")


def moved(found: Study) -> set[int]:
    """Elements whose matrices depend on the parameter."""
    structure = found.model.structure
    return {int(n) for _, at, _ in found.model.placed for n in structure.users(at)}


@pytest.mark.quick(8)
@pytest.mark.parametrize(
    ("region", "expected"),
    [
        ('elements = "2 THRU 3"', {2, 3}),
        ("properties = [2]", {3, 4}),
        ('properties = "1 THRU 5"', {1, 2, 3, 4}),
        ("materials = [1]", {1, 2}),
        ("set = 7", {1, 2, 3}),
        ("set = 7, materials = [2]", {3}),
        ("box = [[1.4, -1, -1], [2.6, 1, 1]]", {2, 3}),
        ("box = [[2.6, 1, 1], [1.4, -1, -1]]", {2, 3}),
        ("near = { point = [0.5, 0, 0], distance = 0.0001 }", {1}),
        ("near = { node = 5, distance = 0.6 }", {4}),
        ("near = { element = 2, distance = 1.01 }", {1, 2, 3}),
        ("near = { element = 20, distance = 0.6 }", {4}),
        ("near = { node = 3, distance = 10.0 }, box = [[0, 0, 0], [1, 0, 0]]", {1}),
    ],
)
def test_elements_of_a_region(tmp_path: Path, region: str, expected: set[int]) -> None:
    assert moved(study(tmp_path, region)) == expected


def test_field_of_all_cards_that_the_region_uses(tmp_path: Path) -> None:
    found = study(tmp_path, "elements = [1, 2, 3]")
    refs = {a.ref for a in found.model.assignments}
    assert refs == {FieldRef("MAT1", 1, "E"), FieldRef("MAT1", 2, "E")}
    assert {a.elements for a in found.model.assignments} == {frozenset({1, 2, 3})}


def test_a_card_beyond_the_region_is_left_alone(tmp_path: Path) -> None:
    found = study(tmp_path, "elements = [1]", '["PBAR I1"]')
    assert {a.ref for a in found.model.assignments} == {FieldRef("PBAR", 1, "I1")}


@pytest.mark.parametrize(
    ("region", "words"),
    [
        ("", "its region has no condition"),
        ("elements = [1, 77]", "no element has number 77"),
        ("near = { point = [1e308, -1e308, 1e308], distance = 1.0 }", "no element lies in its region"),
        ("properties = [3]", "no element has property 3"),
        ("materials = [7, 1]", "no element has material 7"),
        ("set = 8", "has no SET 8"),
        ("box = [[10, 10, 10], [11, 11, 11]]", "no element lies in its region"),
        ("near = { distance = 1.0 }", "one of point, node and element"),
        ("near = { node = 1, point = [0, 0, 0], distance = 1.0 }", "one of point, node and element"),
        ("near = { node = 77, distance = 1.0 }", "grid point 77 does not exist"),
        ("near = { element = 77, distance = 1.0 }", "element 77 does not exist"),
    ],
)
def test_what_a_region_cannot_be(tmp_path: Path, region: str, words: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        study(tmp_path, region)
    text = str(caught.value)
    assert words in text
    assert "parameter.region" in text
    assert "study.toml:11" in text


def test_a_list_that_is_too_short(tmp_path: Path) -> None:
    with pytest.raises(FemtuneError, match=r"'box' has too few entries\n.*study.toml:11"):
        study(tmp_path, "box = [[0, 0, 0]]")
    with pytest.raises(FemtuneError, match="entry 2 of entry 1 of 'box'"):
        study(tmp_path, "box = [[0, nan, 0], [1, 1, 1]]")


@pytest.mark.parametrize(
    ("elements", "field", "says"),
    [("[9]", "MAT1 NU", "no MAT1 card .* NU"), ("[1]", "GRID X1", "GRID.* is not a card with fields")],
)
def test_fields_that_a_region_does_not_have(tmp_path: Path, elements: str, field: str, says: str) -> None:
    with pytest.raises(FemtuneError, match=says):
        study(tmp_path, f"elements = {elements}", f'["{field}"]')
