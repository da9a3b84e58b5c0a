"""Superelements in parts and of reduced matrices have the modes of the same structure in one bulk data section."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.files.nastran import build_structure, read_deck
from femtune.files.nastran.build import BuiltDeck
from femtune.files.nastran.deck import Deck

from .solving import frequencies, reduced

DeckOf = Callable[..., Deck]
CASE = "SOL 103\nCEND\nMETHOD = 1\nSPC = 1\nMPC = 2\nBEGIN BULK\nEIGRL,1,,,10\n"
BULK = "BEGIN BULK\n"
SYSTEM = "CORD2R,9,,0.,0.,0.,0.,.6,.8\n,1.,0.,0.\n"


def strip(cells: range, points: int = 0, others: int = 0, thickness: float = 0.02, frame: str = "") -> str:
    """A strip of shells from x = cells.start to cells.stop, 0.5 wide, stiffened by bars along y = 0.

    `points` and `others` are added to the numbers of grid points, and to all other numbers.
    """
    p, o = points, others
    ends = cells.start, cells.stop
    grids = [
        f"GRID,{p + 2 * x + k + 1},,{x:.1f},{0.5 * k},0.,{frame}" for x in range(ends[0], ends[1] + 1) for k in (0, 1)
    ]
    shells = [
        f"CQUAD4,{o + x + 1},{o + 1},{p + 2 * x + 1},{p + 2 * x + 3},{p + 2 * x + 4},{p + 2 * x + 2}" for x in cells
    ]
    bars = [f"CBAR,{o + x + 101},{o + 2},{p + 2 * x + 1},{p + 2 * x + 3},0.,0.,1." for x in cells]
    cards = [
        f"PSHELL,{o + 1},{o + 1},{thickness},{o + 1},,{o + 1}",
        f"MAT1,{o + 1},{7e10 * (1 + thickness):.8},,.3,2700.",
        f"PBAR,{o + 2},{o + 1},1.-3,1.-7,2.-7,2.-7",
        f"CONM2,{o + 201},{p + 2 * ends[1]},,3.,.1,0.,.05",
        f"MPC,2,{p + 2 * ends[1] + 1},2,1.,{p + 2 * ends[1] - 1},2,-.5",
    ]
    return "\n".join([*grids, *shells, *bars, *cards, ""])


def solved(deck: Deck) -> tuple[BuiltDeck, np.ndarray]:
    built = build_structure(deck)
    return built, frequencies(built.structure)


def notices(built: BuiltDeck) -> list[str]:
    """Which of the notices of superelements there are, by a word of each."""
    words = {"statically": "static", "increased": "numbers", "not reduced": "parts"}
    texts = [n.what for n in built.notices if n.code == "deck.superelement"]
    return [next(name for word, name in words.items() if word in text) for text in texts]


HELD = "SPC1,1,123456,1,2\n"
MAIN = CASE + HELD + strip(range(3))
MANUAL = "SEBULK,3,PRIMARY,,MANUAL\nSECONCT,3,0,,NO\n,7,7,8,8\n"
# the same in one section: rigid elements of no length join the second strip, which has numbers of its own
RIGID = "RBE2,901,7,123456,107\nRBE2,902,8,123456,108\n"


def second(points: int = 0, others: int = 0, frame: str = "") -> str:
    return strip(range(3, 6), points, others, 0.03, frame) + (SYSTEM if frame else "")


@pytest.mark.quick(1)
@pytest.mark.parametrize("search", ["", MANUAL, "SEBULK,3,PRIMARY,,AUTO,1.-4\nSEBNDRY,3,0,7,THRU,12\n"])
@pytest.mark.parametrize("frame", ["", "9"])
def test_parts_with_equal_numbers(deck_of: DeckOf, frame: str, search: str) -> None:
    """Boundary points with the same frame become one; with another one equations join them."""
    built, found = solved(deck_of(MAIN + search + "BEGIN SUPER=3\n" + second(frame=frame) + "ENDDATA\n"))
    reference, expected = solved(deck_of(MAIN + second(100, 500, frame) + RIGID + "ENDDATA\n"))
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    assert notices(built) == ["static", "numbers"]
    assert len(built.structure.nodes.ids) == len(reference.structure.nodes.ids) - (0 if frame else 2)
    # numbers of the part that stand in the residual structure too
    values = built.structure.values
    for number, thickness in ((1, 0.02), (3001, 0.03)):
        at = values.index(FieldRef("PSHELL", number, "T"))
        assert at is not None
        assert values.values[at] == thickness
        assert FieldRef("PSHELL", number, "T") in built.fields
    assert built.deck.cards[built.element_cards[3104]].record == "CBAR 104"


@pytest.mark.slow
def test_a_part_that_is_moved_to_its_place(deck_of: DeckOf) -> None:
    """A part that was modelled elsewhere and turned; its supports and equations are along its own axes."""
    there = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    lines = second(100, 500).split("\n")
    for i, line in enumerate(lines):
        if line.startswith("GRID"):
            fields = line.split(",")
            moved = there @ np.array([float(x) for x in fields[3:6]]) + [4.0, -3.0, 2.0]
            fields[3:6] = [f"{x:.12e}" for x in moved]
            lines[i] = "GRID*,{1},,{3},{4}\n*,{5}".format(*fields)
    part = "\n".join(lines).replace(",,3.,.1,0.,.05", ",,3.,{:.10},{:.10},{:.10}".format(*there @ [0.1, 0.0, 0.05]))
    part = part.replace("0.,0.,1.", "{:.10},{:.10},{:.10}".format(*there @ [0.0, 0.0, 1.0]))
    # the axes of the equation: those of the strip in its place
    part = part.replace("MPC,", "$MPC,")
    main = MAIN + "POINT,901,,3.,0.,0.\nPOINT,902,,3.,.5,0.\nPOINT,903,,4.,0.,0.\nSELOC,3,107,108,109,901,902,903\n"
    built, found = solved(deck_of(main + "BEGIN SUPER=3\n" + part + "ENDDATA\n"))
    expected = solved(deck_of(MAIN + second(100, 500).replace("MPC,", "$MPC,") + RIGID + "ENDDATA\n"))[1]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert notices(built) == ["static"]


@pytest.mark.slow
def test_settings_of_parts(deck_of: DeckOf) -> None:
    """PARAM cards of a part count in that part, those of case control everywhere; SUPER selects supports of a part."""
    part = second(100, 500)
    own = "PARAM,WTMASS,.5\nPARAM,COUPMASS,1\nSPC1,4,123456,114\n"
    case = CASE.replace("BEGIN BULK", "SUBCASE 1\nSUPER = 0\nSUBCASE 2\nSUPER = 3\nSPC = 4\nBEGIN BULK")
    built, found = solved(
        deck_of(case + HELD + strip(range(3)) + "QSET1,0,900\nSPOINT,900\nBEGIN SUPER=3\n" + part + own + "ENDDATA\n")
    )
    main = CASE + HELD + strip(range(3)) + RIGID + "SPC1,1,123456,114\n"
    light = part.replace(",.3,2700.", ",.3,1350.").replace(",,3.,", ",,1.5,")
    # the first strip with lumped mass, the second with consistent mass
    lumped, coupled = (
        [
            reduced(build_structure(deck_of(main + text + "PARAM,COUPMASS," + word + "\nENDDATA\n")).structure)[:2]
            for text in (light, light.replace(",.3,1350.", ",.3,0.").replace(",,1.5,", ",,0.,"))
        ]
        for word in ("-1", "1")
    )
    stiffness, mass = lumped[1][0], lumped[1][1] + coupled[0][1] - coupled[1][1]
    np.testing.assert_allclose(found, _frequencies(stiffness, mass)[: len(found)], rtol=1e-7)
    assert notices(built) == ["static"]


def _frequencies(stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    inverse = scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1]
    return np.asarray(1.0 / np.sqrt(inverse[inverse > 1e-12 * inverse[0]]) / (2 * np.pi))


def _dmig(name: str, matrix: np.ndarray, points: Sequence[tuple[int, int]]) -> str:
    lines = [f"DMIG,{name},0,6,2,0"]
    for j, (column, component) in enumerate(points):
        below = ((n, c, matrix[i, j]) for i, (n, c) in enumerate(points) if i >= j)
        lines.append(f"DMIG*,{name},{column},{component},")
        lines += [f"*,{n},{c},{value:.12e}," for n, c, value in below]
    return "\n".join(lines) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["EXTERNAL", "K2GG"])
def test_external_superelement_of_dmig_cards(deck_of: DeckOf, form: str) -> None:
    """Matrices that were condensed to the boundary give the modes of that condensation."""
    part, main = (build_structure(deck_of(text)).structure for text in (BULK + second() + "ENDDATA\n", MAIN))
    points = [(n, c) for n in (7, 8) for c in range(1, 7)]
    K, M, T = reduced(part)
    kept = np.abs(T[[part.nodes.dof(*p) for p in points]]).argmax(axis=1)
    rest = np.setdiff1d(np.arange(len(K)), kept)
    condense = np.zeros((len(K), len(kept)))
    condense[kept], condense[rest] = np.eye(len(kept)), -np.linalg.solve(K[np.ix_(rest, rest)], K[np.ix_(rest, kept)])
    K, M = condense.T @ K @ condense, condense.T @ M @ condense
    stiffness, mass, T = reduced(main)
    onto = T[[main.nodes.dof(*p) for p in points]]
    expected = _frequencies(stiffness + onto.T @ K @ onto, mass + onto.T @ M @ onto)

    case = CASE if form == "EXTERNAL" else CASE.replace("BEGIN BULK", "K2GG = KRED\nM2GG = MRED\nBEGIN BULK")
    names = ("KAAX", "MAAX") if form == "EXTERNAL" else ("KRED", "MRED")
    grids = "GRID,7,,3.,0.,0.\nGRID,8,,3.,.5,0.\n"
    cards = "".join(_dmig(name, matrix, points) for name, matrix in zip(names, (K, M)))
    bulk = HELD + strip(range(3)) + "SEBULK,3,EXTERNAL,,MANUAL\nSECONCT,3,0\n,7,THRU,8,7,THRU,8\nBEGIN SUPER=3\n"
    built, found = solved(deck_of(case + bulk + grids + cards + "ENDDATA\n"))
    np.testing.assert_allclose(found[:10], expected[:10], rtol=1e-7)
    assert FieldRef("MATRIX", 0, names[0] + ".3") in built.structure.values.refs
    assert not [n for n in built.notices if n.code == "deck.ignored-cards"]
    assert notices(built) == ["parts"]


@pytest.mark.slow
def test_listed_modes_of_external_superelements() -> None:
    """Two external superelements of OP4 files: all 36 elastic modes that NX Nastran lists for the assembly."""
    pyyeti = pytest.importorskip("pyyeti", reason="pyYeti is not installed")
    folder = Path(pyyeti.__file__).parent / "tests" / "nas2cam_extseout"
    if not (folder / "assemble.out").exists():
        pytest.skip("this pyYeti comes without its test decks")
    text = (folder / "assemble.out").read_text(errors="replace")
    rows = [line.split() for line in text.partition("R E A L   E I G E N V A L U E S")[2].splitlines()[1:60]]
    listed = [float(row[4]) for row in rows if len(row) == 7 and row[0].isdigit()][6:42]
    _, found = solved(read_deck(folder / "assemble.dat"))
    assert len(listed) == 36
    np.testing.assert_allclose(found[6:42], listed, rtol=1e-6)


REFUSED = {
    "part.*not in the deck": "SEBULK,3,EXTOP4,,MANUAL,,,101\n",
    "not supported": "SEBULK,3,MIRROR,4\nBEGIN SUPER=3\n" + second(),
    "mirrored, released": "SEMPLN,3,PLANE,1,2,3\nBEGIN SUPER=3\n" + second(),
    "has no point in common": "BEGIN SUPER=3\n" + second().replace(",,3.0", ",,3.1"),
    "several points in one place": "BEGIN SUPER=3\n" + second() + "GRID,99,,3.0,.5,0.\n",
    "point 77 of superelement 3": MANUAL.replace(",7,7,", ",77,7,") + "BEGIN SUPER=3\n" + second(),
    "whose distance 0.5": MANUAL.replace("NO", "YES").replace(",7,7,", ",7,8,") + "BEGIN SUPER=3\n" + second(),
    "joins superelement 5": MANUAL.replace("SECONCT,3,0", "SECONCT,3,5") + "BEGIN SUPER=3\n" + second(),
    "unit 101": "SEBULK,3,EXTOP4,,MANUAL,,,101\nBEGIN SUPER=3\n" + second(),
    "the matrix KAAX": "SEBULK,3,EXTERNAL,,MANUAL\nBEGIN SUPER=3\n" + second(),
}


@pytest.mark.quick(3)
@pytest.mark.parametrize("wording", REFUSED)
def test_what_is_refused_says_superelement(deck_of: DeckOf, wording: str) -> None:
    with pytest.raises(FemtuneError, match=wording) as caught:
        build_structure(deck_of(MAIN + REFUSED[wording] + "ENDDATA\n"))
    assert caught.value.code == "deck.superelement"
    assert "superelement" in str(caught.value)
    assert caught.value.hint
