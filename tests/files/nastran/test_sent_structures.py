"""The structure of every card can be sent to another process, and is the same there to the last bit."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from tests.files.nastran.every_card import DECKS

from femtune.files.nastran.build import build_structure
from femtune.files.nastran.deck import read_deck
from femtune.files.nastran.sections.catalogue import SHAPES
from femtune.parameters.jet import variables


@pytest.mark.quick(8)
@pytest.mark.parametrize("name", DECKS)
def test_a_structure_that_was_sent_is_the_same(name: str, tmp_path: Path) -> None:
    for file, content in DECKS[name].items():
        (tmp_path / file).write_text(content, encoding="latin-1")
    structure = build_structure(read_deck(tmp_path / "deck.bdf"), True).structure
    sent = pickle.loads(pickle.dumps(structure))
    values = structure.values.values
    assert sent.values.refs == structure.values.refs
    assert sent.values.values.tolist() == values.tolist()
    for one, other in zip(structure.values.derived, sent.values.derived, strict=True):
        at = variables(1.01 * values[list(one.sources)])
        with np.errstate(all="ignore"):
            found, again = (rule.function(*(at[i] for i in range(len(one.sources)))) for rule in (one, other))
        np.testing.assert_array_equal(found.value, again.value)
        np.testing.assert_array_equal(found.grad, again.grad)


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_the_properties_of_a_section_that_was_sent_are_the_same(shape: str) -> None:
    formulas = SHAPES[shape].formulas
    sent = pickle.loads(pickle.dumps(formulas))
    sizes = variables(np.linspace(0.1, 0.2, SHAPES[shape].n))
    for role, formula in formulas.items():
        with np.errstate(all="ignore"):
            one, other = (f(*(sizes[i] for i in range(SHAPES[shape].n))) for f in (formula, sent[role]))
        np.testing.assert_array_equal(one.value, other.value)
        np.testing.assert_array_equal(one.grad, other.grad)
