"""CTUBE, CGAP, GENEL, RSPLINE and CQUADR: against closed forms and equivalent cards."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import rigid_body_modes
from femtune.fem.elimination import eliminate
from femtune.fem.structure import Structure
from femtune.files.nastran import Deck
from femtune.files.nastran.build import build_structure

from .solving import frequencies

DeckOf = Callable[..., Deck]
CYLINDER = "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
POINTS = CYLINDER + "GRID,1,,0.,0.,0.\nGRID,2,,0.,2.,0.,5\nGRID,3,,3.,0.,4.,5\nMAT1,1,2.+11,,.3,7850.\n"


def stiffness(structure: Structure) -> np.ndarray:
    out = assemble(structure, "stiffness").toarray()
    for matrix in structure.assembled:
        upper = matrix.upper.toarray()
        out += upper + np.triu(upper, 1).T
    return out


@pytest.mark.parametrize(("outer", "wall"), [(0.1, 0.01), (0.1, 0.05), (0.08, 0.0)])
def test_a_tube_is_a_rod(deck_of: DeckOf, outer: float, wall: float) -> None:
    inner = outer - 2 * wall if wall else 0.0
    area, torsion = np.pi / 4 * (outer**2 - inner**2), np.pi / 32 * (outer**4 - inner**4)
    tube = build_structure(deck_of(POINTS + f"PTUBE,4,1,{outer},{wall},.5\nCTUBE,7,4,2,3\n")).structure
    rod = build_structure(deck_of(POINTS + f"PROD,4,1,{area:.14f},{torsion:.16f},,.5\nCROD,7,4,2,3\n")).structure
    np.testing.assert_allclose(stiffness(tube), stiffness(rod), rtol=1e-9, atol=1e-3)
    np.testing.assert_allclose(assemble(tube, "mass").toarray(), assemble(rod, "mass").toarray(), rtol=1e-9)


@pytest.mark.parametrize("text", ["PTUBE,4,1,.1,.06", "PTUBE,4,1,0.,0.", "PTUBE,4,1,.1,.01,,.2", "PTUBE,4,1,.1,-.01"])
def test_impossible_tubes(deck_of: DeckOf, text: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + text + "\nCTUBE,7,4,2,3\n"))
    assert caught.value.code == "deck.section"


GAPS = {
    "closed": ("PGAP,4,,,9.+5,,3.+4", (9e5, 3e4)),
    "closed, friction": ("PGAP,4,-.1,,9.+5,7.,,.2", (9e5, 1.8e5)),
    "open": ("PGAP,4,.1,,9.+5,7.,3.+4", (7.0, 0.0)),
    "open, without KB": ("PGAP,4,.1,,9.+5", (0.0, 0.0)),
}


@pytest.mark.parametrize("name", GAPS)
def test_a_gap_is_a_spring(deck_of: DeckOf, name: str) -> None:
    card, (along, across) = GAPS[name]
    model = build_structure(deck_of(POINTS + card + "\nCGAP,7,4,1,3,0.,1.,0.\nGRID,4,,3.,0.,4.\n"))
    structure, line = model.structure, np.array([0.6, 0.0, 0.8])
    block = along * np.outer(line, line) + across * (np.eye(3) - np.outer(line, line))
    turn = np.kron(np.eye(2), structure.nodes.frames[2])
    expected = np.zeros((6, 6))
    expected[:3, :3] = block
    np.testing.assert_allclose(stiffness(structure)[:6, 12:18], -expected @ turn, atol=1e-9 * max(along, 1.0))
    np.testing.assert_allclose(stiffness(structure)[:6, :6], expected, atol=1e-9 * max(along, 1.0))
    assert [n.code for n in model.notices] == ["deck.linear-gap"]


def test_a_gap_between_coincident_points_needs_a_system(deck_of: DeckOf) -> None:
    text = POINTS + "GRID,4,,0.,0.,0.\nPGAP,4,,,5.\n"
    one = build_structure(deck_of(text + "CGAP,7,4,1,4,,,,0\n")).structure
    assert stiffness(one)[0, 18] == -5.0
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(text + "CGAP,7,4,1,4,0.,1.,0.\n"))
    assert caught.value.code == "deck.orientation"
    assert "CGAP" in str(caught.value)


@pytest.mark.parametrize("text", ["PGAP,4", "PGAP,4,,,-5.", "PGAP,4,.1,,5.,-1.", "PGAP,4,,,5.,,-1."])
def test_impossible_gaps(deck_of: DeckOf, text: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + text + "\nCGAP,7,4,1,3,0.,1.,0.\n"))
    assert caught.value.code == "deck.field-value"


def test_a_general_element_is_the_bar_that_it_came_from(deck_of: DeckOf) -> None:
    """Flexibility of a cantilevered bar at its tip, supports at its root: the matrix of the bar, in rotated frames."""
    bar = build_structure(
        deck_of(POINTS + "PBAR,4,1,1.-3,2.-6,1.-6,3.-6\nCBAR,7,4,2,3,1.,0.,0.\n", name="bar.bdf")
    ).structure
    K = stiffness(bar)[6:18, 6:18]
    flexibility = np.linalg.inv(K[6:, 6:])
    for word, matrix in (("Z", flexibility), ("K", K[6:, 6:])):
        values = [f"{v:.11E}" for v in matrix[np.triu_indices(6)]]
        pairs = ["3", "1", "3", "2", "3", "3", "3", "4", "3", "5", "3", "6"]
        fixed = ["2", "1", "2", "2", "2", "3", "2", "4", "2", "5", "2", "6"]
        lines = ["GENEL,9,," + ",".join(pairs[:6]), "," + ",".join(pairs[6:]), ",UD,," + ",".join(fixed[:6])]
        lines += ["," + ",".join(fixed[6:]), f",{word}," + ",".join(values[:7])]
        lines += ["," + ",".join(values[i : i + 8]) for i in range(7, 21, 8)]
        general = build_structure(deck_of(POINTS + "\n".join(lines) + "\n", name=f"{word}.bdf")).structure
        found = stiffness(general)[6:18, 6:18]
        np.testing.assert_allclose(found, K, atol=1e-7 * np.abs(K).max())


def test_a_general_element_with_its_own_matrix(deck_of: DeckOf) -> None:
    text = POINTS + "SPOINT,50,51\nGENEL,9,,50,0,51,0\n,UD,,1,1\n,K,5.,-2.,4.\n,S,1.,3.\n"
    found = stiffness(build_structure(deck_of(text)).structure)
    rows = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, -3.0]])
    np.testing.assert_allclose(
        found[np.ix_([18, 19, 0], [18, 19, 0])], rows.T @ np.array([[5.0, -2.0], [-2.0, 4.0]]) @ rows, rtol=1e-12
    )


@pytest.mark.parametrize(
    "lines",
    ["GENEL,9,,1,1\n,K,5.,6.\n", "GENEL,9,,1,1\n,UD,,2,1\n,K,5.\n", "GENEL,9,,1,1,2,1\n,Z,1.,1.,1.\n",
     "GENEL,9,,1,1,2,1\n,K,1.,2.\n", "GENEL,9,,1,1,2,1\n,K,1.,2.,,,,,\n",
     "GENEL,9,,1,1\n", "GENEL,9,,1,1\n,K\n", "GENEL,9,,1,1,1,1\n,K,1.,1.,1.\n"],
)  # fmt: skip
def test_impossible_general_elements(deck_of: DeckOf, lines: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + lines))
    assert caught.value.code == "deck.field-value"


def _follow(structure: Structure) -> np.ndarray:
    one = eliminate(structure.nodes.n_dofs, structure.rigid, set(), structure.nodes.describe)
    return one.T.toarray()


def test_a_spline_is_cubic_between_independent_points(deck_of: DeckOf) -> None:
    text = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,3.,0.,0.\nGRID,4,,4.,0.,0.\nRSPLINE,9,,1,2,123456,3,123456,4\n"
    T = _follow(build_structure(deck_of(text)).structure)
    # v = θ at x = 0 and L: Hermite's polynomials
    for x, row in ((1.0, 6), (3.0, 12)):
        s, L = x / 4.0, 4.0
        cubic = np.array([1 - 3 * s**2 + 2 * s**3, L * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, L * (s**3 - s**2)])
        slope = np.array([-6 * s + 6 * s**2, L * (1 - 4 * s + 3 * s**2), 6 * s - 6 * s**2, L * (3 * s**2 - 2 * s)]) / L
        np.testing.assert_allclose(T[row + 1, [1, 5, 7, 11]], cubic, atol=1e-9)
        np.testing.assert_allclose(T[row + 5, [1, 5, 7, 11]], slope, atol=1e-9)
        np.testing.assert_allclose(T[row + 2, [2, 4, 8, 10]], cubic * [1, -1, 1, -1], atol=1e-9)
        np.testing.assert_allclose(T[row, [0, 6]], [1 - s, s], atol=1e-9)
        np.testing.assert_allclose(T[row + 3, [3, 9]], [1 - s, s], atol=1e-9)


def test_a_spline_of_points_at_one_place(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + "GRID,4,,0.,2.,0.,5\nRSPLINE,9,,1,2,123456,4,123456,3\n"))
    assert caught.value.code == "constraint.own-node"
    assert "grid points 2 and 4" in str(caught.value)


@pytest.mark.parametrize("gap", ["1.-7", "1.-12"])
def test_a_spline_with_a_tiny_segment_is_right_or_an_error(deck_of: DeckOf, gap: str) -> None:
    points = f"GRID,1,,0.,0.,0.\nGRID,2,,{gap},{gap},0.\nGRID,3,,1.,1.,.5\nGRID,4,,1.,1.,2.\n"
    deck = deck_of(points + "RSPLINE,9,1.-3,1,2,123456,3,123456,4\n")
    if gap == "1.-7":
        np.testing.assert_allclose(_follow(build_structure(deck).structure)[6:9, :3], np.eye(3), atol=1e-6)
        return
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck)
    assert caught.value.code == "constraint.spline"
    assert "1.414e-12" in str(caught.value)


def test_a_spline_needs_a_positive_diameter(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + "RSPLINE,9,0.,1,2,123,3\n"))
    assert "D/L" in str(caught.value)


def test_a_spline_follows_rigid_motion(deck_of: DeckOf) -> None:
    text = CYLINDER + (
        "GRID,1,,0.,0.,0.\nGRID,2,,1.,.2,0.,5\nGRID,3,,2.,.5,1.\nGRID,4,,3.,.2,1.,5\nGRID,5,,4.,0.,0.\n"
        "RSPLINE,9,.2,1,2,123,3,,4\n,12346,5\n"
    )
    structure = build_structure(deck_of(text)).structure
    modes, rows = rigid_body_modes(structure.nodes), structure.rigid
    assert len(rows) == 8
    residual = np.zeros((8, 6))
    np.add.at(residual, rows.row, rows.coefficient[:, None] * modes[rows.dof])
    np.testing.assert_allclose(residual, 0.0, atol=1e-9)


@pytest.mark.parametrize(
    "card",
    [
        "RSPLINE,9,,1,2,123,3,1",
        "RSPLINE,9,,1,2,,3",
        "RSPLINE,9,-1.,1,2,1,3",
        "RSPLINE,9,1.-99,1,2,123456,3",
        "RSPLINE,9,1.+99,1,2,123456,3",
        "RSPLINE,9,,1,2",
    ],
)
def test_impossible_splines(deck_of: DeckOf, card: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + card + "\n"))
    assert caught.value.code == "deck.field-value"


PLATE = (
    "".join(
        f"GRID,{1 + i + 5 * j},,{0.1 * i},{0.1 * j},0.,,{'123456' if i == 0 else ''}\n"
        for j in range(3)
        for i in range(5)
    )
    + "MAT1,1,2.+11,,.3,7850.\nPSHELL,3,1,.01,1,,1\n"
)


def _plate(card: str) -> str:
    quads = [(1 + i + 5 * j, 2 + i + 5 * j, 7 + i + 5 * j, 6 + i + 5 * j) for j in range(2) for i in range(4)]
    if card.startswith("CQUAD"):
        return PLATE + "".join(f"{card},{k},3,{a},{b},{c},{d}\n" for k, (a, b, c, d) in enumerate(quads, 1))
    parts = [t for a, b, c, d in quads for t in ((a, b, d), (b, c, d))]
    return PLATE + "".join(f"{card},{k},3,{a},{b},{c}\n" for k, (a, b, c) in enumerate(parts, 1))


def test_cquadr_is_cquad4(deck_of: DeckOf) -> None:
    found = [frequencies(build_structure(deck_of(_plate(card))).structure)[:8] for card in ("CQUADR", "CQUAD4")]
    np.testing.assert_array_equal(*found)


def test_ctriar_bends_as_ctria3_and_is_softer_in_its_plane(deck_of: DeckOf) -> None:
    new, old, quad = (build_structure(deck_of(_plate(card))).structure for card in ("CTRIAR", "CTRIA3", "CQUAD4"))
    found, plain, near = (frequencies(s)[:8] for s in (new, old, quad))
    # bending out of the plane is the same; the first mode in the plane is near that of quadrilaterals
    np.testing.assert_allclose(found[:3], plain[:3], rtol=1e-6)
    first = next(
        f for f in near if f > 100 and np.abs(near / f - 1).min() == 0.0 and np.abs(plain / f - 1).min() > 0.05
    )
    assert np.abs(found / first - 1).min() < 0.05
