"""The catalogue of cards: property cards of elements, values and their units, readers, and the table in the guide."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from femtune.fem.fields import FieldRef
from femtune.files.nastran.catalogue import CATALOGUE, ELEMENT, ELEMENT_READERS, MATERIAL, PROPERTY, CardKind
from femtune.files.nastran.field_units import field_nature

_DOCS = Path(__file__).resolve().parents[3] / "docs"
_UNIT = re.compile(r"|1|\?|±?(P|M|L[²⁴]?|M/L[²³]?|M·L²?|F/L|F·L|F·s/L|F·L·s)")
_ELEMENTS = [kind for kind in CATALOGUE.values() if kind.role == ELEMENT]
_PROPERTIES = [kind for kind in CATALOGUE.values() if kind.role == PROPERTY]


@pytest.mark.parametrize("kind", _ELEMENTS, ids=lambda kind: kind.name)
def test_an_element_with_a_property_number_names_its_property_cards(kind) -> None:
    assert bool(kind.properties) == ("PID" in kind.fields)
    assert {CATALOGUE[name].role for name in kind.properties} <= {PROPERTY}


@pytest.mark.parametrize("kind", _PROPERTIES, ids=lambda kind: kind.name)
def test_a_property_card_belongs_to_an_element(kind) -> None:
    assert kind.fields[0] == "PID"
    assert any(kind.name in element.properties for element in _ELEMENTS)


@pytest.mark.parametrize("name", ["MAT1", "MAT9", "CQUAD8", "CBAR", "PSHELL", "PBAR", "PROD", "CONROD", "CONM2"])
def test_the_values_of_a_card_without_further_lines_are_fields(name: str) -> None:
    assert CATALOGUE[name].values
    assert set(CATALOGUE[name].values) <= set(CATALOGUE[name].fields)


@pytest.mark.parametrize("reader", ELEMENT_READERS)
def test_the_reader_exists_and_takes_a_reading(reader: str) -> None:
    module, function = reader.split(".")
    read = getattr(import_module(f"femtune.files.nastran.{module}"), function)
    parameters = list(inspect.signature(read).parameters.values())
    assert [p.annotation for p in parameters] == ["ElementReading"]


@pytest.mark.parametrize("card", CATALOGUE.values(), ids=lambda card: card.name)
def test_declarations_are_consistent(card: CardKind) -> None:
    assert card.description
    assert all(_UNIT.fullmatch(unit) for unit in card.units.values())
    assert all(CATALOGUE[name].role == PROPERTY for name in card.properties)
    assert card.role != ELEMENT or card.fields[0] == "EID"
    assert card.role != MATERIAL or card.fields[0] == "MID"
    assert card.length is None or card.length >= len(card.fields)


def test_values_of_plies_have_the_unit_of_the_first() -> None:
    assert CATALOGUE["PCOMP"].unit("T7") == "L"
    assert CATALOGUE["PCOMP"].holds("THETA12")
    assert not CATALOGUE["PSHELL"].holds("T7")


@pytest.mark.parametrize(
    ("field", "unit", "positive"),
    [
        (FieldRef("PBAR", 1, "I12"), "L⁴", False),
        (FieldRef("PELAS", 1, "K"), "", True),
        (FieldRef("MAT1", 1, "NU"), "", False),
        (FieldRef("PARAM", 0, "G"), "", True),
        (FieldRef("STIFFNESS", 0, ""), "", True),
        (FieldRef("MATRIX", 0, "JOINT"), "", False),
    ],
)
def test_nature_of_a_field(field: FieldRef, unit: str, positive: bool) -> None:
    nature = field_nature(field)
    assert (nature.unit, nature.positive) == (unit, positive)


def test_the_guide_lists_every_card() -> None:
    spec = spec_from_file_location("card_table", _DOCS / "_ext" / "card_table.py")
    assert spec is not None
    assert spec.loader is not None
    table = module_from_spec(spec)
    spec.loader.exec_module(table)
    text = (_DOCS / table.PAGE).read_text(encoding="utf-8")
    assert table.with_table(text) == text, f"make docs writes the table of {table.PAGE}"
    assert table.shortened(["A", "K1", "K2", "K3", "I1", "I2"]) == ["A", "K1 to K3", "I1", "I2"]
    assert "| CSHEAR, PSHEAR | shear panels | PSHEAR: T, NSM, F1, F2 |" in text
