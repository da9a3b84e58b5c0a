"""Loads of a static preload: their resultants on the grid points, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.files.nastran.build import build_allowing, build_structure
from femtune.files.nastran.deck import Deck, read_deck

CASE = "SOL 103\nCEND\nSPC=1\nSUBCASE 1\n{}\nSUBCASE 2\nMETHOD=5\nSTATSUB(PRELOAD)=1\nBEGIN BULK\n"
CARDS = """EIGRL,5,,,3
CORD2R,4,,0.,0.,0.,1.,0.,0.
,0.,1.,0.
GRID,1,,0.,0.,0.
GRID,2,,2.,0.,0.,4
GRID,3,,2.,3.,0.
GRID,4,,0.,3.,0.
GRID,5,,0.,0.,1.
GRID,6,,2.,0.,1.
GRID,7,,2.,3.,1.
GRID,8,,0.,3.,1.
CHEXA,1,1,1,2,3,4,5,6
,7,8
PSOLID,1,1
CQUAD4,2,2,1,2,3,4
CTRIA3,3,2,1,2,3
PSHELL,2,1,.1,1,,1
MAT1,1,2.+11,,.3,7800.
SPC1,1,123456,1,2,3,4
"""


def _deck(folder: Path, cards: str, selection: str = "LOAD=3") -> Deck:
    path = folder / "deck.bdf"
    path.write_text(CASE.format(selection) + CARDS + cards + "\nENDDATA\n")
    return read_deck(path)


LOADS = {
    "force in a system": ("FORCE,3,1,4,2.,0.,0.,1.", (2.0, 0.0, 0.0)),
    "force at a point with a displacement frame": ("FORCE,3,2,0,2.,1.,-1.,.5", (2.0, -2.0, 1.0)),
    "force along a line": ("FORCE1,3,1,5.,1,3", (10 / np.sqrt(13), 15 / np.sqrt(13), 0.0)),
    "force along a normal": ("FORCE2,3,1,5.,1,2,1,4", (0.0, 0.0, 5.0)),
    "combination": ("LOAD,3,2.,.5,11,-1.,12\nFORCE,11,1,,1.,1.,0.,0.\nFORCE,12,2,,1.,0.,1.,0.", (1.0, -2.0, 0.0)),
    "pressure on points": ("PLOAD,3,7.,1,2,3,4", (0.0, 0.0, 42.0)),
    "pressure on three points": ("PLOAD,3,7.,1,2,3", (0.0, 0.0, 21.0)),
    "pressure on shells": ("PLOAD2,3,7.,2,3", (0.0, 0.0, 63.0)),
    "pressure on a range": ("PLOAD4,3,2,7.,,,,THRU,3", (0.0, 0.0, 63.0)),
    "pressure that varies": ("PLOAD4,3,2,1.,2.,3.,4.", (0.0, 0.0, 15.0)),
    "pressure on a face of a solid": ("PLOAD4,3,1,7.,,,,2,7", (-21.0, 0.0, 0.0)),
    "pressure on its top": ("PLOAD4,3,1,7.,,,,5,7", (0.0, 0.0, -42.0)),
    "pressure in a direction": ("PLOAD4,3,1,7.,,,,5,7\n,0,0.,2.,0.", (0.0, 42.0, 0.0)),
}


@pytest.mark.parametrize("name", LOADS)
def test_the_resultant_is_that_of_the_card(tmp_path: Path, name: str) -> None:
    card, resultant = LOADS[name]
    structure = build_structure(_deck(tmp_path, card)).structure
    assert structure.preload is not None
    forces = structure.preload.forces.reshape(-1, 6)[:, :3]
    basic = np.einsum("nij,nj->ni", structure.nodes.frames, forces)
    np.testing.assert_allclose(basic.sum(axis=0), resultant, atol=1e-12)


BAR = """CBAR,20,20,5,8,0.,0.,1.
,,,{0}
PBAR,20,1,1.-3,1.-6,1.-6,1.-6
PLOAD1,3,20,"""
# element axes of the bar of length 3: x = Y, y = Z, z = X; forces and moments at both ends
ON_BARS = {
    "FZ,FR,0.,4.,1.,4.": [(0, 0, 6), (3, 0, 0), (0, 0, 6), (-3, 0, 0)],  # qL/2, qL²/12
    "FYE,LE,0.,4.,3.,4.": [(0, 0, 6), (3, 0, 0), (0, 0, 6), (-3, 0, 0)],
    "FZE,FR,0.,0.,1.,20.": [(9, 0, 0), (0, 0, -6), (21, 0, 0), (0, 0, 9)],  # 3qL/20, qL²/30, 7qL/20, qL²/20
    "FXE,FR,0.,0.,1.,6.": [(0, 3, 0), (0, 0, 0), (0, 6, 0), (0, 0, 0)],
    "FZ,FR,.5,8.": [(0, 0, 4), (3, 0, 0), (0, 0, 4), (-3, 0, 0)],  # P/2, PL/8
    "FZ,LE,1.,27.": [(0, 0, 20), (12, 0, 0), (0, 0, 7), (-6, 0, 0)],  # Pb²(3a+b)/L³, Pab²/L²
    "MX,FR,.5,6.": [(0, 0, -3), (-1.5, 0, 0), (0, 0, 3), (-1.5, 0, 0)],  # 3M/(2L), M/4
    "MZE,FR,0.,5.,1.,5.": [(0, 0, -5), (0, 0, 0), (0, 0, 5), (0, 0, 0)],
    "MY,FR,0.,5.,1.,5.": [(0, 0, 0), (0, 7.5, 0), (0, 0, 0), (0, 7.5, 0)],
}


@pytest.mark.parametrize("load", ON_BARS)
def test_loads_along_bars_have_their_fixed_end_forces(tmp_path: Path, load: str) -> None:
    structure = build_structure(_deck(tmp_path, BAR.format("") + load)).structure
    assert structure.preload is not None
    forces = structure.preload.forces.reshape(-1, 6)[[4, 7]].reshape(4, 3)
    np.testing.assert_allclose(forces, ON_BARS[load], atol=1e-12)


def test_loads_along_a_bar_act_on_its_offset_line(tmp_path: Path) -> None:
    offset = BAR.format("0.,0.,.5,0.,0.,.5")
    structure = build_structure(_deck(tmp_path, offset + "FX,FR,0.,4.,1.,4.")).structure
    assert structure.preload is not None
    forces = structure.preload.forces.reshape(-1, 6)[[4, 7]].reshape(4, 3)
    np.testing.assert_allclose(forces, [(6, 0, 0), (0, 3, -3), (6, 0, 0), (0, 3, 3)], atol=1e-12)


def test_gravity_and_moments(tmp_path: Path) -> None:
    preload = build_structure(_deck(tmp_path, "GRAV,3,4,9.81,0.,0.,-1.\nMOMENT,3,2,0,3.,0.,1.,0.")).structure.preload
    assert preload is not None
    np.testing.assert_allclose(preload.acceleration, (-9.81, 0.0, 0.0), atol=1e-12)
    # system 4 has its axes along y, z and x
    np.testing.assert_allclose(preload.forces.reshape(-1, 6)[1, 3:], (3.0, 0.0, 0.0), atol=1e-12)


REFUSED = {
    "temperatures": ("TEMP(LOAD)=3", "TEMPD,3,20.", "TEMP(LOAD) = 3 is not read"),
    "rotation": ("LOAD=3", "RFORCE,3,1,,10.,0.,0.,1.", "RFORCE is not read"),
    "enforced displacement": (
        "LOAD=3",
        "FORCE,3,1,,1.,1.,0.,0.\nSPC,1,5,3,.01",
        "enforced displacement (SPC) is not",
    ),
    "load of a projected length": ("LOAD=3", BAR.format("") + "FZ,FRPR,0.,1.,1.,1.", "SCALE = FRPR is not read"),
    "load of a bar with pins": (
        "LOAD=3",
        BAR.format("").replace("\n,,,", "\n,,5") + "FZ,FR,0.,1.,1.,1.",
        "pin flags is not",
    ),
    "line load": ("LOAD=3", "PLOAD4,3,2,7.\n,,,,,LINE", "PLOAD4 with SORL or LDIR is not read"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_other_loads_are_refused_by_name(tmp_path: Path, name: str) -> None:
    selection, cards, text = REFUSED[name]
    deck = _deck(tmp_path, cards, selection)
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck)
    assert caught.value.code == "deck.preload"
    assert text in str(caught.value)
    # the modes of the unloaded structure, on request
    built = build_allowing(deck, ["statsub"])
    assert built.structure.preload is None
    assert any("selects a static preload" in notice.what for notice in built.notices)


WRONG = {
    "PLOAD4,3,1,7.": "do not name a face",
    "PLOAD4,3,1,7.,,,,5,6": "do not name a face",
    "PLOAD2,3,7.,99": "is no shell or solid",
    "PLOAD1,3,1,FX,FR,0.,1.,1.,1.": "is no CBAR or CBEAM",
    BAR.format("") + "FE,FR,0.,1.,1.,1.": "not a direction of a load",
    BAR.format("") + "FX,LE,0.,1.,4.,1.": "does not lie on the bar",
    BAR.format("") + "FX,FR,.5,1.,,2.": "P2 is the load at X2",
    "FORCE1,3,1,5.,2,2": "direction of the load is undefined",
    "FORCE,4,1,,1.,1.,0.,0.": "no load card has the set number 3",
    "FORCE,3,99,,1.,1.,0.,0.": "99",
}


@pytest.mark.parametrize("card", WRONG)
def test_wrong_loads_are_errors(tmp_path: Path, card: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(_deck(tmp_path, card))
    assert WRONG[card] in str(caught.value)


@pytest.mark.parametrize(("places", "wrong"), [("0.,1.,1.2", "1.2"), ("-.2,1.,.5", "-.2"), (".5,1.,.2", ".2")])
def test_the_field_of_a_place_off_the_bar_is_named(tmp_path: Path, places: str, wrong: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(_deck(tmp_path, BAR.format("") + f"FX,FR,{places},1."))
    assert caught.value.values["text"] == repr(wrong)


def test_what_is_solved_is_told(tmp_path: Path) -> None:
    built = build_structure(_deck(tmp_path, "PLOAD2,3,7.,2"))
    told = {n.code: n for n in built.notices}
    assert "STATSUB(PRELOAD) = 1 (LOAD = 3)" in told["deck.preload-solved"].what
    assert told["deck.following-load"].level == "warning"
    assert {use.name: use.use for use in built.cards}["PLOAD2"] == "read"
