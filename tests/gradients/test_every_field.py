"""Every value of every card as a parameter: K, M, C and H with first and second derivatives by complex steps.

The fields come from the catalogue of cards, so that none can be forgotten.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.files.nastran.card_samples import decks_of_samples, names_in

from femtune.errors import FemtuneError
from femtune.fem import FieldRef
from femtune.fem.assemble import assemble
from femtune.files.nastran import BuiltDeck, plan_edits, read_deck, write_deck
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.catalogue import CATALOGUE
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.sections import SHAPES
from femtune.model import Assignment, Configuration, ModelPoint, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet, jet
from femtune.testing import check_matrix_derivatives

from .field_decks import DECKS

# the ends of bars are values only where a parameter names them: tests/fem/test_offsets.py moves them
CARDS = [kind.name for kind in CATALOGUE.values() if kind.values and kind.name not in ("CBAR", "CBEAM")]
# their many stations take a third of the time of all cards
TAPERED = ("PBEAM", "PBEAML", "PBCOMP")
KINDS = ("stiffness", "mass", "viscous", "hysteretic")
# fields of a card that are parameters of one model, so that their mixed second derivatives are checked too
TOGETHER = 3
X = np.linspace(0.01, 0.03, 30)
MOST_DIMENSIONS = max(shape.n for shape in SHAPES.values())
# dimensions that no known section has
NOWHERE = {f"DIM{i}{end}" for i in range(MOST_DIMENSIONS + 1, 11) for end in ("", "B")}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, BuiltDeck]:
    folder = tmp_path_factory.mktemp("decks")
    out = {}
    held = names_in("".join(DECKS.values())) | (set(CATALOGUE) - set(CARDS))
    for name, text in {**DECKS, **decks_of_samples(held)}.items():
        path = folder / f"{name}.bdf"
        path.write_text(text)
        out[name] = build_structure(read_deck(path))
    return out


def fields_of(card: str, built: dict[str, BuiltDeck]) -> dict[str, list[FieldRef]]:
    """One field of each name, by deck; a name that no deck has a value of fails."""
    found: dict[str, list[FieldRef]] = {}
    for name in CATALOGUE[card].values:
        if name not in NOWHERE:
            deck, ref = next(_usable(card, name, built), ("", None))
            assert ref is not None, f"no deck has a value {card} {name} that can be updated"
            found.setdefault(deck, []).append(ref)
    return found


def _usable(card: str, name: str, built: dict[str, BuiltDeck]) -> Iterator[tuple[str, FieldRef]]:
    for deck, model in built.items():
        values = model.structure.values
        for ref, value in zip(values.refs, values.values):
            if (ref.card, ref.name) == (card, name) and value != 0.0:
                try:
                    resolve(model, parse_field_ref(str(ref)))
                except FemtuneError:
                    continue
                yield deck, ref


def point_of(built: BuiltDeck, refs: list[FieldRef], relative: bool) -> ModelPoint:
    """The model with a parameter a field, a little away from the deck's values."""
    table = built.structure.values
    start = {ref: 1.0 if relative else table.values[table.index(ref)] for ref in refs}
    names = ParameterSet(
        tuple(Parameter(f"p{i}", at, at - abs(at), at + abs(at)) for i, at in enumerate(start.values()))
    )
    assignments = [Assignment(f"p{i}", ref, relative) for i, ref in enumerate(refs)]
    model = configure(parametric_model(built.structure, names, assignments), Configuration())
    return model.at(X[: len(refs)])


@pytest.mark.quick(0, gate=3)
@pytest.mark.parametrize(
    "card", [*(pytest.param(c, marks=pytest.mark.slow) if c in TAPERED else c for c in CARDS), "PARAM"]
)
def test_derivatives_of_every_field(card: str, built: dict[str, BuiltDeck]):
    fields = {"lines": [FieldRef("PARAM", 0, "G")]} if card == "PARAM" else fields_of(card, built)
    sets = [(deck, refs[i : i + TOGETHER]) for deck, refs in fields.items() for i in range(0, len(refs), TOGETHER)]
    for number, (deck, together) in enumerate(sets):
        # factors of the deck's values and the values themselves in turn: they differ by one multiplication
        point = point_of(built[deck], together, relative=number % 2 == 0)
        check_matrix_derivatives(point)
        for i, ref in enumerate(together):
            sizes = [abs(getattr(point, f"{kind}_derivatives")[i]).max() for kind in KINDS]
            assert max(sizes) > 0.0, f"nothing depends on {ref}"


@pytest.mark.slow
@pytest.mark.quick(4, rest="long")
@pytest.mark.parametrize("card", CARDS)
def test_a_deck_written_at_other_values_has_the_matrices_of_the_parameters(
    card: str, built: dict[str, BuiltDeck], tmp_path: Path
):
    for deck, refs in fields_of(card, built).items():
        plan = plan_edits(built[deck], point_of(built[deck], refs, False).configured.model.field_values(X[: len(refs)]))
        written = build_structure(read_deck(write_deck(plan.edited, tmp_path).main)).structure
        index = built[deck].structure.values.index
        moved = built[deck].structure.values.evaluate(
            {index(ref): jet.constant(value, 0) for ref, value in plan.values.items()}, 0
        )
        own = replace(built[deck].structure, values=replace(built[deck].structure.values, values=moved.value))
        for kind in KINDS:
            one, other = assemble(own, kind), assemble(written, kind)
            assert abs(one - other).max() <= 1e-13 * abs(other).max(), f"{kind} of {refs}"


REFUSED = {
    "PBAR 11 I12": ("parameter.without-effect", "does not change the matrices"),
    "PBAR 18 K1": ("parameter.without-effect", "does not change the matrices"),
    "PBAR 99 A": ("parameter.touches-nothing", "no element's stiffness"),
    "CBAR 1 W1A": ("parameter.touches-nothing", "CBAR 1"),
    "GRID 1 X1": ("study.unknown-field", "GRID"),
    "PSHELL 1 Z1": ("study.unknown-field", "no field 'Z1'"),
    "CQUAD4 1 T": ("parameter.derived-field", "mean of its corner thicknesses"),
    "CTRIA3 4 ZOFFS": ("parameter.touches-nothing", "is blank in the deck"),
    "PSHELL 3 TS": ("parameter.touches-nothing", "no element's stiffness"),
}


@pytest.mark.slow
@pytest.mark.parametrize("text", REFUSED)
def test_fields_without_effect_are_refused_with_the_reason(text: str, built: dict[str, BuiltDeck]):
    deck = built["shells" if text.split(maxsplit=1)[0] in ("CQUAD4", "CTRIA3", "PSHELL") else "lines"]
    code, reason = REFUSED[text]
    with pytest.raises(FemtuneError, match=re.escape(reason)) as caught:
        _parameter_on(deck, text)
    assert caught.value.code == code


def _parameter_on(built: BuiltDeck, text: str) -> None:
    """As a study does it."""
    ref = parse_field_ref(text)
    resolve(built, ref)
    parametric_model(built.structure, ParameterSet((Parameter("p"),)), [Assignment("p", ref, False)])
