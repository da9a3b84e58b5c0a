"""The parts of `femtune run`, from the declarations of the steps."""

from __future__ import annotations

import pytest

from femtune.steps import all_steps
from femtune.steps.run.run import parts_of_run
from femtune.steps.step import load

_UNTIL_SAVED = [
    *("model", "correlate", "checks of later steps", "respond", "select", "update", "truncation", "left-out modes"),
    *("correlate after", "file for ParaView", "measured damping", "unused FRFs", "vibration tests"),
]
_AFTERWARDS = ["specimens", "quantify", "bootstrap", "posterior", "live model"]
_OF_DECK = ["write back", "correlate as written", "compare the deck as written"]


@pytest.mark.parametrize("with_deck", [True, False])
def test_a_part_comes_after_those_whose_outcomes_it_needs(with_deck: bool) -> None:
    names = [part.name for part in parts_of_run(with_deck)]
    deck = _OF_DECK if with_deck else []
    assert names == [*_UNTIL_SAVED, *_AFTERWARDS, *deck, "expanded shapes", "respond", "judge"]


@pytest.mark.parametrize("with_deck", [True, False])
def test_no_two_parts_have_one_place(with_deck: bool) -> None:
    places = [part.place for part in parts_of_run(with_deck)]
    assert places == sorted(set(places))


def test_a_part_is_in_the_folder_of_its_step() -> None:
    parts = [(step, part) for step in all_steps() for part in step.in_run]
    assert len(parts) > 20
    for step, part in parts:
        assert part.work.startswith(f"{step.name}.in_run:")
        assert callable(load(part.work))
