"""CWELD and CFAST: against bars, bushes, equations and RBE3 that are written by hand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import rigid_body_modes
from femtune.fem.elimination import eliminate
from femtune.fem.structure import Structure, join_constraints
from femtune.files.nastran import Deck
from femtune.files.nastran.build import build_structure

DeckOf = Callable[..., Deck]
D, AREA = 0.2, np.pi / 4 * 0.2**2
SIDE = np.sqrt(np.pi) / 2 * D
SYSTEMS = "CORD2R,5,,0.,0.,0.,.3,.2,.9\n,1.,.4,0.\n"
PLATES = (
    SYSTEMS
    + """GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.,5
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
GRID,5,,2.,0.,0.
GRID,6,,2.,1.,0.
GRID,11,,-.1,-.1,.3
GRID,12,,1.4,-.1,.3
GRID,13,,1.4,1.1,.3,5
GRID,14,,-.1,1.1,.3
GRID,30,,.4,.35,.2
MAT1,1,2.+11,,.3,7850.,,,.02
MAT1,2,1.+11,4.+10,,5000.,,,.03
PSHELL,1,1,.02,1,,1
PSHELL,2,1,.04,1,,1
CQUAD4,1,1,1,2,3,4
CQUAD4,2,1,2,5,6,3
CQUAD4,3,2,11,12,13,14
"""
)
WARPED = PLATES.replace("GRID,3,,1.,1.,0.", "GRID,3,,1.1,1.,.1").replace("GRID,13,,1.4,1.1,.3", "GRID,13,,1.5,1.2,.45")
ELEMID = "CWELD,9,8,30,ELEMID\n,1,3\n"
ELPAT = "CWELD,9,8,30,ELPAT\n,1,3\n"
ROUND = f"PBAR,8,2,{AREA:.12f},{np.pi / 64 * D**4:.14f},{np.pi / 64 * D**4:.14f},{np.pi / 32 * D**4:.14f}\n,\n,.9,.9\n"


def matrices(deck: Deck) -> tuple[np.ndarray, np.ndarray, Structure]:
    """K, M of the elements on the free DOFs of grid points 1 to 14, after the equations of the deck."""
    structure = build_structure(deck).structure
    rows = [structure.rigid, *structure.multipoint_sets.values()]
    n = structure.nodes.n_dofs
    keep = [6 * i + k for i, number in enumerate(structure.nodes.ids) if number < 15 for k in range(6)]
    K, M = (assemble(structure, name).toarray() for name in ("stiffness", "mass"))
    if not any(map(len, rows)):
        return K[np.ix_(keep, keep)], M[np.ix_(keep, keep)], structure
    found = eliminate(n, join_constraints(rows), (), structure.nodes.describe)
    at = np.searchsorted(found.free, keep)
    T = found.T.toarray()
    return (T.T @ K @ T)[np.ix_(at, at)], (T.T @ M @ T)[np.ix_(at, at)], structure


def without_mass(text: str) -> str:
    """The bar of the reference has none: where a weld's mass goes is tested apart."""
    return text.replace("MAT1,2,1.+11,4.+10,,5000.", "MAT1,2,1.+11,4.+10,,0.")


def shape(corners: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear functions of a rectangle in the plane x y, and their gradients, written out anew."""
    (x0, y0), (x1, y1) = corners[0], corners[2]
    x, y = (place - (x0, y0)) / (x1 - x0, y1 - y0)
    functions = np.array([(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y])
    slopes = np.array([[-(1 - y), 1 - y, y, -y], [-(1 - x), -x, x, 1 - x]]) / [[x1 - x0], [y1 - y0]]
    return functions, slopes


def equation(number: int, dependent: tuple[int, int], terms: list[tuple[int, int, float]]) -> str:
    fields = [dependent[0], dependent[1], "-1.", *(v for n, c, a in terms for v in (n, c, f"{a:.12g}"))]
    text, at = f"MPC,{number}", 0
    while at < len(fields):
        text += "," + ",".join(map(str, fields[at : at + 6])) + ",,"
        at += 6
        text += "\n," if at < len(fields) else "\n"
    return text


LOWER, UPPER = (
    np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]),
    np.array([[-0.1, -0.1], [1.4, -0.1], [1.4, 1.1], [-0.1, 1.1]]),
)
IN_PLANE = PLATES.replace(",5\n", "\n")
"""The same plates, all displacements along the basic axes, as the equations of the reference have them."""


def slopes_tied(point: int, grids: tuple[int, ...], corners: np.ndarray, place: np.ndarray) -> str:
    N, by = shape(corners, place)
    out = "".join(equation(7, (point, c), [(g, c, a) for g, a in zip(grids, N)]) for c in (1, 2, 3))
    out += equation(7, (point, 4), [(g, 3, a) for g, a in zip(grids, by[1])])
    out += equation(7, (point, 5), [(g, 3, -a) for g, a in zip(grids, by[0])])
    half = [(g, 2, a / 2) for g, a in zip(grids, by[0])] + [(g, 1, -a / 2) for g, a in zip(grids, by[1])]
    return out + equation(7, (point, 6), half)


def test_a_weld_of_shells_is_a_bar_with_equations(deck_of: DeckOf) -> None:
    place = np.array([0.4, 0.35])
    text = without_mass(IN_PLANE)
    weld, *_ = matrices(deck_of(text + ELEMID + f"PWELD,8,2,{D}\n"))
    ends = "GRID,21,,.4,.35,0.\nGRID,22,,.4,.35,.3\nCBAR,9,8,21,22,1.,0.,0.\n" + ROUND
    tied = slopes_tied(21, (1, 2, 3, 4), LOWER, place) + slopes_tied(22, (11, 12, 13, 14), UPPER, place)
    bar, *_ = matrices(deck_of(text + ends + tied))
    np.testing.assert_allclose(weld, bar, atol=1e-8 * np.abs(bar).max())
    listed = "CWELD,9,8,30,GRIDID\n,1,2,3,4\n,11,12,13,14\n"
    np.testing.assert_allclose(matrices(deck_of(text + listed + f"PWELD,8,2,{D}\n"))[0], weld, atol=1e-9 * weld.max())


def auxiliary(first: int, grids: dict[tuple[float, float], tuple[tuple[int, ...], np.ndarray]], z: float) -> str:
    out = ""
    for k, (place, (own, corners)) in enumerate(grids.items()):
        N, _ = shape(corners, np.array(place))
        out += f"GRID,{first + k},,{place[0]:.12f},{place[1]:.12f},{z},,456\n"
        out += "".join(equation(7, (first + k, c), [(g, c, a) for g, a in zip(own, N)]) for c in (1, 2, 3))
    return out


def patches_tied(x: float, y: float) -> str:
    """Points 21 and 22 with RBE3 of four points on the shells each; the lower ones may lie on two shells."""
    corners = [(x + i * SIDE / 2, y + j * SIDE / 2) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    right = np.array([[1.0, 0], [2, 0], [2, 1], [1, 1]])
    lower = {p: ((2, 5, 6, 3), right) if p[0] > 1 else ((1, 2, 3, 4), LOWER) for p in corners}
    upper = dict.fromkeys(corners, ((11, 12, 13, 14), UPPER))
    tied = auxiliary(41, lower, 0.0) + auxiliary(51, upper, 0.3)
    ends = f"GRID,21,,{x},{y},0.\nGRID,22,,{x},{y},.3\n"
    ends += "RBE3,61,,21,123456,1.,123,41,42\n,43,44\nRBE3,62,,22,123456,1.,123,51,52\n,53,54\n"
    return tied + ends


@pytest.mark.slow
@pytest.mark.parametrize("x", [0.4, 0.97])
def test_a_weld_of_patches_is_a_bar_with_averaging_elements(deck_of: DeckOf, x: float) -> None:
    text = without_mass(IN_PLANE.replace("GRID,30,,.4", f"GRID,30,,{x}"))
    weld, *_ = matrices(deck_of(text + ELPAT + f"PWELD,8,2,{D}\n"))
    bar, *_ = matrices(deck_of(text + patches_tied(x, 0.35) + "CBAR,9,8,21,22,1.,0.,0.\n" + ROUND))
    np.testing.assert_allclose(weld, bar, atol=1e-8 * np.abs(bar).max())
    by_property = f"CWELD,9,8,,PARTPAT\n,1,2\n,{x},.35,.1\nPWELD,8,2,{D}\n"
    np.testing.assert_allclose(matrices(deck_of(text + by_property))[0], weld, atol=1e-9 * weld.max())


SPRINGS = "2.+8,3.+7,4.+7,5.+5\n,6.+5,7.+5,3.,.05\n"


@pytest.mark.slow
@pytest.mark.parametrize(("system", "flag", "own"), [("", "", ",1.,0.,0."), ("5", "1", ",,,,5"), ("5", "0", "")])
def test_a_fastener_is_a_bush_with_averaging_elements(deck_of: DeckOf, system: str, flag: str, own: str) -> None:
    x, y = 0.97, 0.35
    text = IN_PLANE
    if not own:
        # the second axis of system 5, as an orientation vector
        z = np.array([0.3, 0.2, 0.9]) / np.linalg.norm([0.3, 0.2, 0.9])
        second = np.cross(z, [1.0, 0.4, 0.0])
        own = "," + ",".join(f"{v:.12f}" for v in second / np.linalg.norm(second))
    card = f"CFAST,9,8,PROP,1,2,,,\n,{x},{y},.2\nPFAST,8,{D},{system},{flag},{SPRINGS}"
    fastener, mass, _structure = matrices(deck_of(text + card))
    values = "PBUSH,8,K,2.+8,3.+7,4.+7,5.+5,6.+5,7.+5\n"
    reference = text + patches_tied(x, y) + f"CBUSH,9,8,21,22{own}\n" + values + "CONM2,71,21,,1.5\nCONM2,72,22,,1.5\n"
    bush, masses, _ = matrices(deck_of(reference))
    np.testing.assert_allclose(fastener, bush, atol=1e-9 * np.abs(bush).max())
    np.testing.assert_allclose(mass, masses, atol=1e-9 * np.abs(masses).max())
    named = card.replace("PROP,1,2", "ELEM,1,3")
    np.testing.assert_allclose(matrices(deck_of(text + named))[0], fastener, atol=1e-9 * fastener.max())


@pytest.mark.parametrize(
    "card", [ELEMID, ELPAT, "CWELD,9,8,,ALIGN,2,12\n", ELEMID.replace("30,ELEMID", ",ELEMID,30,30")]
)
@pytest.mark.parametrize("text", [PLATES, WARPED])
def test_rigid_motions_are_free_of_strain(deck_of: DeckOf, card: str, text: str) -> None:
    structure = build_structure(deck_of(text + card + f"PWELD,8,2,{D}\n")).structure
    weld = next(b for b in structure.batches if b.card == "CWELD")
    alone = Structure(structure.nodes, structure.values, (weld,))
    K, motions = assemble(alone, "stiffness").toarray(), rigid_body_modes(structure.nodes)
    assert np.linalg.matrix_rank(K, tol=1e-6 * np.abs(K).max()) == 6
    assert np.abs(K @ motions).max() < 1e-9 * np.abs(K).max()
    mass = motions.T @ assemble(alone, "mass").toarray() @ motions
    distance = {"ALIGN": np.linalg.norm([0.4, -0.1, 0.3])}.get(card.split(",")[4].strip())
    if text is PLATES:
        assert np.trace(mass[:3, :3]) / 3 == pytest.approx(5000.0 * AREA * (distance or 0.3))


def test_an_aligned_weld_is_a_bar(deck_of: DeckOf) -> None:
    text = without_mass(PLATES)
    weld, *_ = matrices(deck_of(text + f"CWELD,9,8,,ALIGN,2,12\nPWELD,8,2,{D}\n"))
    bar, *_ = matrices(deck_of(text + "CBAR,9,8,2,12,0.,1.,0.\n" + ROUND))
    np.testing.assert_allclose(weld, bar, atol=1e-8 * np.abs(bar).max())


def axial(deck: Deck, card: str = "CWELD") -> float:
    """Stiffness against a motion of the upper plate along the weld."""
    structure = build_structure(deck).structure
    weld = next(b for b in structure.batches if b.card == card)
    K = assemble(Structure(structure.nodes, structure.values, (weld,)), "stiffness").toarray()
    up = np.zeros(len(K))
    for i, number in enumerate(structure.nodes.ids):
        if 11 <= number <= 14:
            up[6 * i : 6 * i + 3] = structure.nodes.frames[i].T @ [0.0, 0.0, 1.0]
    return float(up @ K @ up)


@pytest.mark.parametrize(
    ("section", "length"),
    [("", 0.3), (",,,,,\n,2.,", 0.4), (",,,,,\n,,1.25", 0.25), (",,,,,SPOT", 0.03), (",,,,,\n,.2,5.", 0.3)],
)
def test_the_effective_length_follows_limits_and_thicknesses(deck_of: DeckOf, section: str, length: float) -> None:
    stiffness = axial(deck_of(PLATES + ELEMID + f"PWELD,8,2,{D}{section}\n"))
    assert stiffness == pytest.approx(1e11 * AREA / length)


def test_a_weld_without_length_stands_on_the_normal(deck_of: DeckOf) -> None:
    text = PLATES.replace(",.3\n", ",0.\n").replace(",.3,5\n", ",0.,5\n")
    assert axial(deck_of(text + ELEMID + f"PWELD,8,2,{D}\n")) == pytest.approx(1e11 * AREA / (0.2 * D))


def test_quadratic_patches_and_triangles(deck_of: DeckOf) -> None:
    text = PLATES + "GRID,41,,.5,0.,0.\nGRID,42,,1.,.5,0.\nGRID,43,,.5,1.,0.\nGRID,44,,0.,.5,0.\n"
    card = f"CWELD,9,8,30,GRIDID,,,QT\n,1,2,3,4,41,42,43,44\n,11,13,14\nPWELD,8,2,{D}\n"
    structure = build_structure(deck_of(text + card)).structure
    weld = next(b for b in structure.batches if b.card == "CWELD")
    assert weld.nodes.shape == (1, 11)
    K = assemble(Structure(structure.nodes, structure.values, (weld,)), "stiffness").toarray()
    assert np.abs(K @ rigid_body_modes(structure.nodes)).max() < 1e-9 * np.abs(K).max()


@pytest.mark.parametrize(
    ("cards", "code", "words"),
    [
        ("CWELD,9,8,30,SOLID\n", "deck.connector", "SOLID"),
        ("CWELD,9,8,30,ELEMID\n,1,99\n", "deck.connector", "99"),
        ("CWELD,9,8,30,ELEMID\n,2,3\n", "deck.connector", "outside of shell 2"),
        ("CWELD,9,8,,ELEMID\n,1,3\n", "deck.connector", "place"),
        ("CWELD,9,8,,PARTPAT\n,1,77\n,.4,.3,0.\n", "deck.connector", "77"),
        ("CWELD,9,8,,PARTPAT\n,1,2\n,.02,.3,0.\n", "deck.connector", "auxiliary"),
        ("CWELD,9,8,,PARTPAT\n,1,2\n,9.,.3,0.\n", "deck.connector", "property 1"),
        ("CWELD,9,8,30,GRIDID\n,1,2,3,4\n", "deck.connector", "second surface"),
        ("CWELD,9,8,30,GRIDID\n,1,2\n,11,12,13\n", "deck.connector", "corners"),
        ("CWELD,9,8,,ALIGN,1,1\n", "deck.zero-length", ""),
        ("CFAST,9,7,ELSE,1,3\n", "deck.connector", "PROP ELEM"),
        ("CWELD,9,6,30,ELEMID\n,1,3\n", "deck.connector", "diameter"),
        ("CWELD,9,5,,ELEMID,30\n,1,3\n", "deck.connector", "MSET"),
        ("CWELD,9,4,30,ELEMID\n,1,3\n", "deck.connector", "LDMIN"),
        ("CWELD,9,8,,PARTPAT\n,1,2\n,.4,-1.+200,0.\n", "deck.field-value", "field = 3 of continuation 2"),
        ("CWELD,9,3,,PARTPAT\n,1,2\n,.4,.3,0.\n", "deck.connector", "coincide"),
        ("PFAST,6,1.+40\nCFAST,10,6,ELEM,1,3,,,,\n,.4,.3,0.\n", "deck.connector", "diameter"),
    ],
)
def test_what_cannot_be_tied_is_an_error(deck_of: DeckOf, cards: str, code: str, words: str) -> None:
    sections = "PWELD,8,2,.2\nPFAST,7,.2\nPWELD,6,2,0.\nPWELD,5,2,.2,,,ON\nPWELD,4,2,.2,,,,,\n,6.,5.\nPWELD,3,2,1.-30\n"
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(PLATES + cards + sections))
    assert caught.value.code == code
    assert words in str(caught.value)


def test_the_diameter_of_a_weld_of_patches_is_no_parameter(deck_of: DeckOf) -> None:
    built = build_structure(deck_of(PLATES + ELPAT + f"PWELD,8,2,{D}\n"))
    assert not [ref for ref in built.fields if ref.card == "PWELD"]
    built = build_structure(deck_of(PLATES + ELEMID + f"PWELD,8,2,{D}\n"))
    assert [str(ref) for ref in built.fields if ref.card == "PWELD"] == ["PWELD 8 D"]
