"""The table of understood cards: property cards of elements, and values that stand on the card."""

from __future__ import annotations

import pytest

from femtune.files.nastran.catalogue import CATALOGUE, ELEMENT, PROPERTY

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
