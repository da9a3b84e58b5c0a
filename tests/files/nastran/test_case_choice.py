"""Which subcase is used, and what its modes leave out."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from femtune.errors import FemtuneError, Notice
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.case_control import CaseControl
from femtune.files.nastran.deck import Deck

DeckOf = Callable[..., Deck]

BULK = """BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
CBAR,1,1,1,2,0.,1.,0.
PBAR,1,1,.01,1.-6,1.-6,1.-6
MAT1,1,2.1+11,,.3,7850.
SPC1,1,123456,1
SPC1,2,123456,2
EIGRL,5,,,4
EIGRL,6,,,3
ENDDATA
"""


def _deck(deck_of: DeckOf, case: str, solution: str = "103") -> Deck:
    return deck_of(f"SOL {solution}\nCEND\n" + case.replace("; ", "\n") + "\n" + BULK)


def _case(deck_of: DeckOf, case: str, solution: str = "103") -> CaseControl:
    return _deck(deck_of, case, solution).case_control


CHOICES = {
    "METHOD in the second": ("SUBCASE 1; SPC=1; LOAD=3; SUBCASE 2; SPC=2; METHOD=5", (2, 2, 5), "info"),
    "ANALYSIS in the second":
        ("METHOD=5; SUBCASE 1; SPC=1; ANALYSIS=STATICS; SUBCASE 2; SPC=2; ANALYSIS=MODES", (2, 2, 5), "info"),
    "METHOD of buckling": ("SUBCASE 1; SPC=1; ANALYSIS=BUCK; METHOD=6; SUBCASE 2; SPC=2; ANALYSIS=MODES; METHOD=5",
                           (2, 2, 5), "info"),
    "several METHOD":
        ("SUBCASE 1; SPC=1; SUBCASE 2; SPC=2; METHOD=6; SUBCASE 3; SPC=1; METHOD=5", (2, 2, 6), "warning"),
    "METHOD for all": ("METHOD=5; SUBCASE 1; SPC=2; SUBCASE 2; SPC=1", (1, 2, 5), "warning"),
    "METHOD for all, one is a preload": ("METHOD=5; SUBCASE 1; SPC=2; SUBCASE 2; SPC=1; STATSUB=1", (2, 1, 5), "info"),
    "no METHOD": ("SUBCASE 1; SPC=1; SUBCASE 2; SPC=2", (1, 1, None), "warning"),
    "ANALYSIS alone": ("SUBCASE 1; SPC=1; SUBCASE 2; SPC=2; ANALYSIS=MODES", (2, 2, None), "info"),
    "combination": ("SUBCASE 1; SPC=2; METHOD=5; SUBCOM 9; SUBSEQ=1.; SPC=1; METHOD=6", (1, 2, 5), None),
    "one subcase": ("SPC=1; SUBCASE 4; SPC=2; METHOD=5", (4, 2, 5), None),
    "step": ("SPC=1; SUBCASE 1; STEP 1; LOAD=3; STEP 2; ANALYSIS=MODES; METHOD=5; SPC=2", (1, 2, 5), "info"),
    "step inherits":
        ("SUBCASE 1; SPC=2; STEP 1; ANALYSIS=NLSTATICS; STEP 2; ANALYSIS=MODES; METHOD=5", (1, 2, 5), "info"),
}  # fmt: skip


@pytest.mark.parametrize("name", CHOICES)
def test_the_subcase_that_requests_modes_is_used(deck_of: DeckOf, name: str) -> None:
    text, (used, spc, method), level = CHOICES[name]
    case = _case(deck_of, text)
    assert (case.used, case.spc, case.method) == (used, spc, method)
    assert [(n.code, n.level) for n in case.notices] == ([("deck.several-subcases", level)] if level else [])


def test_several_requests_are_named(deck_of: DeckOf) -> None:
    (notice,) = _case(deck_of, "SUBCASE 1; SUBCASE 20; METHOD=6; SUBCASE 30; METHOD=5").notices
    assert notice.what == "the subcases 20, 30 request modes (METHOD); only the first of them, 20, is used"


def test_method_of_sol_105_is_not_used(deck_of: DeckOf) -> None:
    case = _case(deck_of, "SPC=1; SUBCASE 1; LOAD=3; SUBCASE 2; SPC=2; METHOD=5", "105")
    assert (case.used, case.spc, case.method) == (1, 1, None)


def test_sets_and_commands_are_those_of_the_used_subcase(deck_of: DeckOf) -> None:
    text = "SET 1 = 7; SUBCASE 1; SET 2 = 8; AUTOSPC = NO; SUBCASE 2; METHOD=5; SET 2 = 9; K2GG = STIFF"
    case = _case(deck_of, text)
    assert {number: numbers.expand() for number, numbers in case.sets.items()} == {1: (7,), 2: (9,)}
    assert [command.name for command in case.effective] == ["K2GG"]
    assert [command.name for command in case.others] == ["AUTOSPC", "K2GG"]


def _left_out(deck: Deck) -> list[Notice]:
    return [n for n in build_structure(deck, allow_missing=True, preloaded=False).notices if n.code == "deck.left-out"]


LEFT_OUT = {
    "SUBCASE 1; SPC=1; LOAD=3; TEMP(LOAD)=4; SUBCASE 2; METHOD=5; STATSUB(PRELOAD)=1":
        ("103", "STATSUB(PRELOAD) = 1 (LOAD = 3, TEMP(LOAD) = 4) selects a static preload;", "warning"),
    "METHOD=5; STATSUB=7": ("103", "STATSUB = 7 selects a static preload;", "warning"),
    "SUBCASE 1; STEP 1; NLPARM=1; STEP 2; ANALYSIS=MODES; METHOD=5": ("400", "SOL 400 with STEP 1 before", "warning"),
    "METHOD=5; LOAD=1": ("106", "SOL 106 is a nonlinear solution", "warning"),
    "LOAD=1": ("106", "SOL 106 is a nonlinear solution", "warning"),
    "SPC=1; METHOD=5": ("5", "SOL 5 requests buckling loads", "warning"),
    "SUBCASE 1; LOAD=3; SUBCASE 2; METHOD=5": ("13", "differential stiffness of a static load (LOAD = 3)", "warning"),
    "METHOD=5; STATSUB(BUCKLING)=1": ("103", "STATSUB(BUCKLING) = 1 selects the preload of a buckling", "warning"),
    "METHOD=5; PARAM,NMLOOP,3": ("106", "PARAM NMLOOP = 3: the modes are those of the undeformed", "warning"),
    "METHOD=5; SPC=1": ("105", "SOL 105 requests buckling loads", "warning"),
    "METHOD=5 ; SPC=1": ("31", "SOL 31 of MYSTRAN requests Craig-Bampton modes", "warning"),
    "CMETHOD=5; SPC=1": ("107", "CMETHOD = 5 requests complex modes", "warning"),
    "METHOD=5; CMETHOD=6": ("SEMCEIG", "CMETHOD = 6 requests complex modes", "warning"),
    "METHOD=5; SPC=2": ("110", "SOL 110 requests complex modes", "warning"),
    "METHOD=5; MFLUID=4": ("103", "MFLUID = 4 adds fluid", "warning"),
    "METHOD=5; BGSET=4": ("103", "BGSET = 4 glues parts", "warning"),
    "METHOD=5; BCSET=4": ("103", "BCSET = 4 selects contact", "warning"),
    "METHOD=5; BOLTLD=4": ("103", "BOLTLD = 4 selects bolt loads", "warning"),
    "METHOD=5; RGYRO=4": ("103", "RGYRO = 4 selects a rotor", "warning"),
}  # fmt: skip


@pytest.mark.parametrize("case", LEFT_OUT)
def test_what_the_modes_leave_out_is_warned_of(deck_of: DeckOf, case: str) -> None:
    solution, text, level = LEFT_OUT[case]
    (notice,) = _left_out(_deck(deck_of, case, solution))
    assert text in notice.what
    assert notice.level == level


@pytest.mark.parametrize(
    "case",
    ["METHOD=5; SPC=1", "METHOD=5; TEMP(LOAD)=4; LOAD=3", "SUBCASE 1; LOAD=3; STATSUB=1; SUBCASE 2; METHOD=5",
     "METHOD=5; BCONTACT=NONE"],
)  # fmt: skip
def test_loads_without_effect_on_the_modes_are_not_warned_of(deck_of: DeckOf, case: str) -> None:
    assert _left_out(_deck(deck_of, case)) == []


REFUSED = {
    "SUBCASE 1; DEFORM=3; SUBCASE 2; METHOD=5; STATSUB(PRELOAD)=1": ("103", "STATSUB"),
    "SUBCASE 1; TEMP(LOAD)=3; SUBCASE 2; METHOD=5; STATSUB=1": ("103", "STATSUB"),
    "METHOD=5; STATSUB=7": ("103", "STATSUB"),
    "SUBCASE 1; SPC=1; SUBCASE 2; METHOD=5; STATSUB(PRELOAD)=7": ("103", "STATSUB"),
    "SUBCASE 1; LOAD=3; SUBCASE 2; METHOD=5; STATSUB=2": ("103", "STATSUB"),
    "SUBCASE 1; STEP 1; NLPARM=1; STEP 2; ANALYSIS=MODES; METHOD=5": ("400", "STEP"),
    "METHOD=5; PARAM,NMLOOP,3": ("106", "NMLOOP"),
    "METHOD=5; NLIC=2": ("103", "NLIC"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_modes_of_a_loaded_structure_are_refused(deck_of: DeckOf, case: str) -> None:
    solution, name = REFUSED[case]
    with pytest.raises(FemtuneError) as caught:
        build_structure(_deck(deck_of, case, solution))
    assert caught.value.code == "deck.preload"
    assert f'["{name}"]' in str(caught.value)


@pytest.mark.parametrize("case", [case for case in LEFT_OUT if case not in REFUSED and "STATSUB(PRELOAD)" not in case])
def test_other_effects_do_not_stop_the_modes(deck_of: DeckOf, case: str) -> None:
    assert build_structure(_deck(deck_of, case, LEFT_OUT[case][0])).structure is not None


def test_matrices_of_responses_are_a_notice(deck_of: DeckOf) -> None:
    (notice,) = _left_out(_deck(deck_of, "METHOD=5; K2PP=KAAX"))
    assert ("K2PP = KAAX" in notice.what, notice.level) == (True, "info")


def test_the_subcase_of_the_residual_structure_is_used(deck_of: DeckOf) -> None:
    text = "SUBCASE 1; SUPER=100; METHOD=5; SUBCASE 2; SUPER=200,1; METHOD=5; SUBCASE 5; METHOD=6; SPC=2"
    case = _case(deck_of, text)
    assert (case.used, case.method, case.spc) == (5, 6, 2)
