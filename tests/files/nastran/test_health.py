"""Doubts about valid models: planted faults are told, with their place; sound models raise no alarm."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.files.nastran.plates import HEAD, PLATE, SECOND, flat, grid, shells, tube

from femtune.errors import FemtuneError
from femtune.files.nastran import Deck, build_structure, read_deck
from femtune.files.nastran.health import health_notices

DeckOf = Callable[..., Deck]
CODES = (
    "deck.coincident-points", "deck.free-part", "deck.repeated-elements", "deck.alternating-normals", "deck.far-ends",
)  # fmt: skip


SEAM = ["RBE2,{e},{a},123456,{b}\n", "CBUSH,{e},9,{a},{b},,,,0\n", "MPC,7,{a},1,1.,{b},1,-1.\n",
        "RBAR,{e},{a},{b},123456\n"]  # fmt: skip
BOX = "".join(
    f"GRID,{1 + i + 2 * j + 4 * k},,{float(i)},{float(j)},{float(k)}\n" for k in (0, 1) for j in (0, 1) for i in (0, 1)
)
HEXA = "CHEXA,1,2,1,2,4,3,5,6\n,8,7\n"


def _told(deck_of: DeckOf, text: str) -> dict[str, str]:
    return {n.code: n.what for n in build_structure(deck_of(text)).notices if n.code in CODES}


SOUND = {
    "plate": PLATE,
    "plate with offsets to one side": PLATE.replace(shells(4), shells(4, offset=",,.005")),
    "merged tube": HEAD + "SPC1,1,123456,1\n" + grid(12, tube)
    + re.sub(r",(6[1-5]),(6[1-5]),", lambda m: f",{int(m[1]) - 60},{int(m[2]) - 60},", shells(12)),
    "box of plates with offsets": HEAD + "SPC1,1,123456,1\n" + BOX
    + "CQUAD4,1,1,1,2,4,3,,.01\nCQUAD4,2,1,1,5,6,2,,.01\nCQUAD4,3,1,1,3,7,5,,.01\n",
    "hexahedron": HEAD + "SPC1,1,123,1\n" + BOX + HEXA,
    "springs across a seam and a strut": PLATE + SECOND.replace("101,,1.000000", "101,,1.010000")
    + "".join(f"CELAS2,{910 + j},1.+6,{21 + j},{k},{101 + j},{k}\n" for j in range(5) for k in (1,))
    + "".join(f"CELAS2,{920 + 10 * j + k},1.+6,{21 + j},{k},{101 + j},{k}\n" for j in range(5) for k in range(2, 7))
    + "GRID,801,,9.,0.,0.\nCELAS2,990,1.+6,6,1,801,1\nPBUSH,9,K,1.+6\nCBUSH,991,9,6,801,,,,0\n",
    "bars side by side": HEAD + "SPC1,1,123456,1\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nPBAR,3,1,1.-4,1.-8,1.-8,1.-8\n"
    "CBAR,1,3,1,2,0.,1.,0.\nCBAR,2,3,1,2,0.,1.,0.\n",
    **{
        f"seam of {link.partition(',')[0]}": PLATE.replace("SPC = 1\n", "SPC = 1\nMPC = 7\n") + SECOND
        + "PBUSH,9,K,1.+6,1.+6,1.+6,1.+6,1.+6,1.+6\n"
        + "MPC,7,1,1,1.,6,1,0.\n"
        + "".join(link.format(e=900 + j, a=21 + j, b=101 + j) for j in range(5))
        for link in SEAM
    },
}  # fmt: skip


@pytest.mark.parametrize("name", SOUND)
def test_sound_models_raise_no_alarm(deck_of: DeckOf, name: str) -> None:
    assert _told(deck_of, SOUND[name]) == {}


_PLIES = "MAT8,8,1.+11,1.+10,.3,5.+9,,,1600.\nPCOMP,1\n,8,.002,0.,,8,.004,90."
_LAMINATE = PLATE.replace("PSHELL,1,1,.01,1,,1", _PLIES)
FAULTS = {
    "two plates that were not merged": (PLATE + SECOND, {
        "deck.coincident-points": "5 pairs of grid points of parts that nothing connects are in one place: 21 and 101",
        "deck.free-part": "2 parts that nothing connects, of which 1 has no support: 25 grid points, the first is 101",
    }),
    "one point of the seam is merged": (PLATE + SECOND.replace(",101,106", ",21,106").replace("GRID,101", "$"), {
        "deck.coincident-points": "4 pairs of grid points are in one place and not connected: 22 and 102",
    }),
    "tube that is open along a line": (HEAD + "SPC1,1,123456,1,61\n" + grid(12, tube) + shells(12), {
        "deck.coincident-points": "5 pairs of grid points are in one place and not connected: 1 and 61",
    }),
    "two solids that were not merged": (
        HEAD + "SPC1,1,123,1,2,3,4\n" + BOX + HEXA
        + "".join(f"GRID,{10 + k},,{k % 2}.,{k // 2 % 2}.,{1 + k // 4}.\n" for k in range(8))
        + "CHEXA,2,2,10,11,13,12,14,15\n,17,16\n", {
        "deck.coincident-points": "4 pairs of grid points of parts that nothing connects",
        "deck.free-part": "2 parts that nothing connects, of which 1 has no support: 8 grid points, the first is 10",
    }),
    "doubled shells": (PLATE + shells(4, 1, 501), {
        "deck.repeated-elements": "16 CQUAD4 elements lie on the grid points of another one with the same property",
    }),
    "doubled shells in another order": (PLATE + "CQUAD4,77,1,7,2,1,6\n", {
        "deck.repeated-elements": "1 CQUAD4 element lies",
    }),
    "two skins of other properties": (PLATE + "PSHELL,6,1,.02,1\nCQUAD4,77,6,1,6,7,2\n", {
        "deck.repeated-elements": "with another property: 1 and 77",
    }),
    "doubled solid": (HEAD + "SPC1,1,123,1\n" + BOX + HEXA + HEXA.replace("CHEXA,1", "CHEXA,9"), {
        "deck.repeated-elements": "1 CHEXA element",
    }),
    "spring to a wrong grid point": (
        PLATE + "GRID,801,,9.,0.,0.\nCELAS2,990,1.+6,7,3,801,3\nCELAS2,992,1.+6,8,3,801,3\n", {
        "deck.far-ends": "the ends of CELAS2 992 (and 1 more) are 8.754 apart, at grid points 8 and 801",
    }),
    "bush to a wrong grid point": (
        PLATE + "GRID,801,,0.,9.,0.\nPBUSH,9,K,1.+6,1.+6,1.+6\nCBUSH,990,9,6,801,,,,0\n", {
        "deck.far-ends": "the ends of CBUSH 990 are",
    }),
    "one shell with offset is reversed": (
        PLATE.replace(shells(4), shells(4, offset=",,.005")).replace(",7,12,13,8,", ",8,13,12,7,"), {
        "deck.alternating-normals": "the normals of 4 pairs of neighbouring shells",
    }),
    "every second triangle is reversed": (
        HEAD + "SPC1,1,123456,1\n" + grid(1, flat, m=1)
        + "CTRIA3,1,1,1,3,4,,.01\nCTRIA3,2,1,1,2,4,,.01\n", {
        "deck.alternating-normals": "the normals of 1 pair of neighbouring shells",
    }),
    "one shell of an unsymmetric laminate is reversed": (_LAMINATE.replace(",7,12,13,8\n", ",8,13,12,7\n"), {
        "deck.alternating-normals": "the normals of 4 pairs of neighbouring shells",
    }),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_planted_faults_are_told(deck_of: DeckOf, name: str) -> None:
    text, wanted = FAULTS[name]
    told = _told(deck_of, text)
    assert told.keys() == wanted.keys()
    for code, words in wanted.items():
        assert words in told[code]


def test_offsets_that_follow_the_normals_are_sound(deck_of: DeckOf) -> None:
    """A reversed element whose offset has the other sign has its mid-surface where its neighbours have theirs."""
    text, _ = FAULTS["one shell with offset is reversed"]
    assert _told(deck_of, text.replace("8,13,12,7,,.005", "8,13,12,7,,-.005")) == {}


def test_reversed_shells_of_a_mirrored_or_symmetric_laminate_are_sound(deck_of: DeckOf) -> None:
    text, _ = FAULTS["one shell of an unsymmetric laminate is reversed"]
    mirrored = text.replace("6,1,8,13,12,7", "6,2,8,13,12,7") + "PCOMP,2\n,8,.004,90.,,8,.002,0.\n"
    assert mirrored != text
    assert _told(deck_of, mirrored) == {}
    assert _told(deck_of, text.replace("8,.004,90.", "8,.002,0.")) == {}


def test_the_place_is_that_of_the_card(deck_of: DeckOf) -> None:
    notices = build_structure(deck_of(PLATE + SECOND)).notices
    (notice,) = [n for n in notices if n.code == "deck.coincident-points"]
    assert notice.where is not None
    assert notice.where.record == "GRID 101"


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["nastran_decks", "field_decks"])
def test_decks_of_the_field_raise_no_alarm(shared_data: Path, folder: str) -> None:
    """Level: none of the decks at hand has such a fault."""
    decks = [p for p in sorted((shared_data / folder).rglob("*")) if p.suffix in (".bdf", ".dat", ".nas")]
    assert decks
    for path in decks:
        try:
            notices = build_structure(read_deck(path)).notices
        except FemtuneError:
            continue
        assert not [n for n in notices if n.code in CODES], path


def test_a_model_without_grid_points(deck_of: DeckOf) -> None:
    built = build_structure(deck_of("SPOINT,1,2\nCELAS4,1,100.,1,2\nCMASS4,2,1.,1\n"))
    assert health_notices(built.structure, built.place_of_element, built.place_of_grid) == []  # type: ignore[arg-type]
