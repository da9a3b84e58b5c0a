"""Damping of the whole model and of modes: PARAM G, W3, W4, KDAMP, TABDMP1 and SDAMPING."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import Deck, read_deck, write_deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.field_refs import parse_field_ref, resolve
from femtune.files.nastran.write import plan_edits

DeckOf = Callable[..., Deck]
BASE = "SPOINT,1\nCELAS2,1,100.,1\nCMASS2,2,4.,1\n"
G = FieldRef("PARAM", 0, "G")


def with_case(case: str, bulk: str) -> str:
    return f"SOL 111\nCEND\n{case}\nBEGIN BULK\n{BASE}{bulk}ENDDATA\n"


def test_overall_damping(deck_of: DeckOf) -> None:
    built = build_structure(deck_of(BASE + "PARAM,G,.03\nPARAM,W3,62.8\nPARAM,W4,31.4\n"))
    damping, values = built.structure.damping, built.structure.values
    assert (damping.overall_omega, damping.element_omega) == (62.8, 31.4)
    assert damping.loss_factor == resolve(built, parse_field_ref("param g"))
    assert values.values[values.index(G) or 0] == 0.03
    assert built.structure.users(values.index(G) or 0).tolist() == [1, 2]
    assert not built.notices
    assert build_structure(deck_of(BASE)).structure.damping.loss_factor is None


@pytest.mark.parametrize("line", ["PARAM,G,.03", "PARAM   G       .03     $ note", "PARAM*  G               .03",
                                  "PARAM,G,.03 $ 3 %"])  # fmt: skip
def test_the_overall_loss_factor_is_written_back(deck_of: DeckOf, line: str, tmp_path: Path) -> None:
    text = BASE + line + "\nCMASS2,3,1.,1\n"
    plan = plan_edits(build_structure(deck_of(text)), {G: 0.0425})
    main = write_deck(plan.edited, tmp_path / "new").main
    again = build_structure(read_deck(main))
    assert again.structure.values.values[resolve(again, G)] == 0.0425
    changed = [(a, b) for a, b in zip(text.splitlines(), main.read_text().splitlines(), strict=True) if a != b]
    assert len(changed) == 1
    assert changed[0][1].split("$")[1:] == line.split("$")[1:]


def test_a_loss_factor_of_case_control_counts_and_cannot_be_updated(deck_of: DeckOf) -> None:
    built = build_structure(deck_of(with_case("PARAM,G,.05", "PARAM,G,.03\n")))
    index = built.structure.damping.loss_factor
    assert index is not None
    assert built.structure.values.values[index] == 0.05
    with pytest.raises(FemtuneError) as error:
        resolve(built, G)
    assert error.value.code == "study.unknown-field"
    assert "the bulk data section has no PARAM G" in str(error.value)


@pytest.mark.parametrize(("text", "message"), [("PARAM W3", "cannot be updated"), ("PARAM", "cannot be updated")])
def test_other_params_are_no_fields(text: str, message: str) -> None:
    with pytest.raises(FemtuneError, match=message):
        parse_field_ref(text)


def test_a_missing_param_is_told(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError, match="has no PARAM G"):
        resolve(build_structure(deck_of(BASE)), G)


@pytest.mark.parametrize("card", ["PARAM,W3,-1.", "PARAM,W4,-1.", "PARAM,G,ABC"])
def test_params_that_cannot_be(deck_of: DeckOf, card: str) -> None:
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(BASE + card + "\n"))
    assert error.value.code == "deck.param"


TABLE = "TABDMP1,7,CRIT\n,1.,.01,2.,SKIP,3.,.03,4.,.05\n,5.,.05,ENDT\n"


def built_with(deck_of: DeckOf, case: str, bulk: str = TABLE) -> BuiltDeck:
    return build_structure(deck_of(with_case(case, bulk)))


def test_the_selected_table(deck_of: DeckOf) -> None:
    built = built_with(deck_of, "SDAMPING = 7")
    assert built.modal_damping is built.damping_tables[7]
    assert built.modal_damping is not None
    np.testing.assert_allclose(built.modal_damping.ratio([1.0, 2.0, 3.5, 9.0]), [0.01, 0.02, 0.04, 0.05])
    assert not built.modal_damping.hysteretic
    assert not built.notices


def test_no_selection_is_no_modal_damping(deck_of: DeckOf) -> None:
    built = built_with(deck_of, "SDAMPING(FLUID) = 7")
    assert built.modal_damping is None
    assert list(built.damping_tables) == [7]


def test_damping_of_modes_as_imaginary_stiffness(deck_of: DeckOf) -> None:
    damping = built_with(deck_of, "SDAM = 7", TABLE + "PARAM,KDAMP,-1\n").modal_damping
    assert damping is not None
    assert damping.hysteretic


@pytest.mark.parametrize(("kind", "value"), [("", ".04"), ("G", ".04"), ("CRIT", ".02"), ("Q", "25.")])
def test_types_of_tables(deck_of: DeckOf, kind: str, value: str) -> None:
    damping = built_with(deck_of, "SDAMPING = 7", f"TABDMP1,7,{kind}\n,0.,{value},9.,{value},ENDT\n").modal_damping
    assert damping is not None
    assert damping.ratio([3.0]) == pytest.approx([0.02])


def test_a_table_of_one_pair_is_constant(deck_of: DeckOf) -> None:
    damping = built_with(deck_of, "SDAMPING = 7", "TABDMP1,7,CRIT\n,0.,.02,ENDT\n").modal_damping
    assert damping is not None
    np.testing.assert_array_equal(damping.ratio([0.0, 4.0]), [0.02, 0.02])


@pytest.mark.parametrize(
    ("case", "bulk", "code", "message"),
    [
        ("SDAMPING = 8", TABLE, "deck.missing-set", "no TABDMP1 card has that number"),
        ("SDAMPING = X", TABLE, "deck.case-control", "by its number"),
        ("", "TABDMP1,7,CRIT\n,1.,.01,2.,.03\n", "deck.damping-table", "no ENDT"),
        ("", "TABDMP1,7,CRIT\n,ENDT\n", "deck.damping-table", "no pairs"),
        ("", "TABDMP1,7,LOSS\n,1.,.01,ENDT\n", "deck.damping-table", "not a type of damping"),
        ("", "TABDMP1,7,CRIT\n,1.,.01,3.,.01,2.,.01\n,ENDT\n", "deck.damping-table", "neither ascending nor desc"),
        ("", "TABDMP1,7,CRIT\n,1.,,2.,.02,ENDT\n", "deck.blank-field", "needs a real number"),
        ("", TABLE + TABLE, "deck.duplicate-id", "table 7"),
        ("SDAMPING = 7", TABLE + "TABDMP1,A,CRIT\n,1.,.01,ENDT\n", "deck.not-an-integer", "must be an integer"),
    ],
)
def test_errors(deck_of: DeckOf, case: str, bulk: str, code: str, message: str) -> None:
    with pytest.raises(FemtuneError) as error:
        built_with(deck_of, case, bulk)
    assert error.value.code == code
    assert message in str(error.value)


def test_a_broken_table_is_not_called_missing(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError) as error:
        built_with(deck_of, "SDAMPING = 7", "TABDMP1,7,CRIT\n,1.,.01,2.,.03\n")
    assert error.value.code == "deck.damping-table"


def test_large_loss_factors_are_told_once(deck_of: DeckOf) -> None:
    text = BASE + "PELAS,3,1.,2.5,,4,1.,3.\nCELAS1,3,3,1\nCELAS1,4,4,1\nPELAS,5,1.,1.9\nCELAS1,5,5,1\n"
    (notice,) = build_structure(deck_of(text)).notices
    assert notice.code == "deck.large-loss-factor"
    assert "PELAS 3 GE = 2.5 (and 1 more)" in notice.what


def test_proportional_damping_is_told(deck_of: DeckOf) -> None:
    (notice,) = build_structure(deck_of(BASE + "PARAM,ALPHA1,.1\n")).notices
    assert "proportional to mass and stiffness is not modelled" in notice.what
