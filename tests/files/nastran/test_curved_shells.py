"""CQUAD8 and CTRIA6 as batches: grid points that are left out, corner thicknesses, axes, laminates, refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure

DeckOf = Callable[..., Deck]
POINTS = "".join(
    f"GRID,{number},,{x},{y},0.\n"
    for number, x, y in [(1, 0.0, 0.0), (2, 2.0, 0.0), (3, 2.0, 1.0), (4, 0.0, 1.0), (5, 1.0, 0.0), (6, 2.0, 0.5),
                         (7, 1.0, 1.0), (8, 0.0, 0.5), (9, 1.0, 0.5)]
)  # fmt: skip
STEEL = "MAT1,1,2.,,.25,3.,,,.01\n"
PLATE = "PSHELL,9,1,.1,1,,1\n"
QUAD = "CQUAD8,20,9,1,2,3,4,5,6\n,7,8"


def built(deck_of: DeckOf, text: str) -> BuiltDeck:
    return build_structure(deck_of(POINTS + STEEL + text))


def value(model: BuiltDeck, role: str, i: int = 0) -> float:
    (batch,) = model.structure.batches
    return float(model.structure.values.values[batch.roles[role][i]])


def test_whole_elements_and_elements_with_fewer_points(deck_of: DeckOf) -> None:
    text = (
        PLATE + QUAD + "\nCQUAD8,21,9,1,2,3,4\nCQUAD8,22,9,1,2,3,4,,6,\nCTRIA6,23,9,1,2,3,5,6,9\nCTRIA6,24,9,1,2,3,,6\n"
    )
    quads, triangles = built(deck_of, text).structure.batches
    assert (quads.kind, quads.card, triangles.kind, triangles.card) == ("shell-quad8", "CQUAD8", "shell-tri6", "CTRIA6")
    assert quads.nodes.tolist() == [
        [0, 1, 2, 3, 4, 5, 6, 7], [0, 1, 2, 3, -1, -1, -1, -1], [0, 1, 2, 3, -1, 5, -1, -1],
    ]  # fmt: skip
    assert triangles.nodes.tolist() == [[0, 1, 2, 4, 5, 8], [0, 1, 2, -1, 5, -1]]
    assert triangles.dofs[1].tolist() == [*range(18), *[-1] * 6, *range(30, 36), *[-1] * 6]


def test_fields_have_the_places_of_the_manual(deck_of: DeckOf) -> None:
    """T1 to T4, THETA, ZOFFS, TFLAG behind G8 of a CQUAD8; THETA, ZOFFS, T1 to T3, TFLAG behind G6 of a CTRIA6."""
    model = built(deck_of, PLATE + QUAD + ",.1,.2,,.4,30.,.05\n,0\n")
    assert [value(model, f"t{i}") for i in (1, 2, 3, 4)] == [0.1, 0.2, 0.1, 0.4]
    assert (value(model, "t"), value(model, "z0")) == (pytest.approx(0.2), 0.05)
    (batch,) = model.structure.batches
    assert batch.facts["theta"][0] == pytest.approx(np.pi / 6)
    assert batch.facts["uneven"][0]
    factors = built(deck_of, PLATE + "CTRIA6,20,9,1,2,3,5,6,9\n,45.,-.02,1.,2.,,1\n")
    assert [value(factors, f"t{i}") for i in (1, 2, 3)] == [0.1, 0.2, 0.1]
    assert (value(factors, "z0"), factors.structure.batches[0].facts["theta"][0]) == (-0.02, pytest.approx(np.pi / 4))
    assert not [n for n in (*model.notices, *factors.notices) if n.code == "deck.uneven-thickness"]


@pytest.mark.parametrize("card", ["CQUAD8", "CTRIA6"])
def test_thickness_that_varies_bends_by_its_cube_and_weighs_by_its_mean(deck_of: DeckOf, card: str) -> None:
    """Curvature κ everywhere: E'κ²/12 ∫ t³ dA with t linear along x, from a at x = 0 to b at x = 2."""
    a, b = 0.1, 0.3
    elements = {
        "CQUAD8": f"{QUAD},{a},{b},{b},{a}\n",
        "CTRIA6": f"CTRIA6,20,9,1,2,3,5,6,9\n,,,{a},{b},{b}\nCTRIA6,21,9,1,3,4,9,7,8\n,,,{a},{b},{a}\n",
    }
    structure = built(deck_of, "PARAM,COUPMASS,1\n" + PLATE + elements[card]).structure
    xyz = structure.nodes.xyz
    u = np.zeros((len(xyz), 6))
    u[:, 2], u[:, 4] = 0.5 * xyz[:, 0] ** 2, -xyz[:, 0]
    found = u.ravel() @ (assemble(structure, "stiffness") @ u.ravel())
    cube = 2.0 * (a**4 - b**4) / (4.0 * (a - b))
    # seven points integrate t³ times a constant exactly, as 3 × 3 do
    assert found == pytest.approx(2.0 / 0.9375 / 12.0 * cube, rel=1e-10)
    mass = mass_properties(structure.nodes, assemble(structure, "mass"))
    np.testing.assert_allclose(mass.directional_mass, 3.0 * 2.0 * (a + b) / 2.0, rtol=1e-12)
    assert mass.centre[0] == pytest.approx(2.0 * (a / 2 + (b - a) / 3) / ((a + b) / 2), rel=1e-12)


@pytest.mark.parametrize("element", [QUAD, "CTRIA6,20,9,1,2,3,5,6,9\nCTRIA6,21,9,3,4,1,7,8,9"])
def test_a_cross_ply_couples_stretch_and_curvature(deck_of: DeckOf, element: str) -> None:
    """[0/90]: energy of strain ε and curvature κ along x is A ε² + 2 B εκ + D κ², with A, B, D of the two plies."""
    plies = "MAT8,2,10.,1.,.25,.5,.4,.4,2.\nPCOMP,9\n,2,.1,0.,,2,.1,90.\n"
    structure = built(deck_of, plies + element + "\n").structure
    scale = 1.0 / (1.0 - 0.25**2 / 10.0)
    lower, upper = 10.0 * scale, 1.0 * scale
    A, B, D = 0.1 * (lower + upper), 0.005 * (upper - lower), 0.1**3 / 3.0 * (lower + upper)
    xyz, (strain, bend) = structure.nodes.xyz, (0.3, -0.7)
    u = np.zeros((len(xyz), 6))
    u[:, 0], u[:, 2], u[:, 4] = strain * xyz[:, 0], -0.5 * bend * xyz[:, 0] ** 2, bend * xyz[:, 0]
    found = u.ravel() @ (assemble(structure, "stiffness") @ u.ravel())
    assert found == pytest.approx(2.0 * (A * strain**2 + 2 * B * strain * bend + D * bend**2), rel=1e-9)


def test_a_laminate_of_one_law_is_a_plate_of_it(deck_of: DeckOf) -> None:
    one = built(deck_of, "PSHELL,9,1,.1,1,,1,.833333\n" + QUAD + "\n").structure
    other = built(deck_of, "PCOMP,9\n,1,.04,,,1,.06\n" + QUAD + "\n").structure
    for kind in ("stiffness", "mass"):
        a, b = (assemble(s, kind).toarray() for s in (one, other))
        np.testing.assert_allclose(b, a, atol=1e-6 * np.abs(a).max())


def test_non_structural_mass_is_of_the_curved_area(deck_of: DeckOf) -> None:
    """A side bulges: the area is that of rectangle and parabola, 2 + 2/3 · 2 · 0.3, and a total is spread over it."""
    text = POINTS.replace("GRID,5,,1.0,0.0,0.", "GRID,5,,1.0,-.3,0.") + "MAT1,1,2.,,.25\n" + PLATE + QUAD + "\n"
    head = "SOL 103\nCEND\nNSM = 5\nBEGIN BULK\n"
    for mass, total in (("NSM1,5,PSHELL,7.,9\n", 7.0 * 2.4), ("NSML1,5,PSHELL,7.,9\n", 7.0)):
        structure = build_structure(deck_of(head + text + mass)).structure
        found = mass_properties(structure.nodes, assemble(structure, "mass"))
        np.testing.assert_allclose(found.directional_mass, total, rtol=1e-6)


REFUSED = (
    ("CQUAD8,20,9,1,2,3,4,5,6\n,7,5\n", "deck.shell-corners", "has grid point 5 twice"),
    ("CQUAD8,20,9,1,2,3,3,5,6\n,7,8\n", "deck.shell-corners", "with a CTRIA6"),
    ("CTRIA6,20,9,1,2,1\n", "deck.shell-corners", "grid point 1"),
    ("CQUAD8,20,9,1,2,3\n", "deck.blank-field", "field = 7"),
    ("CQUAD8,20,9,1,2,3,0\n", "deck.unknown-grid", "0"),
    ("CTRIA6,20,9,1,2,3,99\n", "deck.unknown-grid", "99"),
    (QUAD + ",-.1,.1,.1,.1\n", "deck.shell-section", "T1 to T4"),
    (QUAD + ",.1,.1,-.1,.1\n", "deck.shell-section", "text = '-.1'"),
    (QUAD + ",.1,1.+999\n", "deck.not-a-real", "correct its exponent"),
    (QUAD + ",.1,.1,.1,.1,,,\n,2\n", "deck.field-value", "TFLAG"),
    (QUAD.replace(",9,", ",8,") + ",.1\n", "deck.shell-section", "laminate"),
)


@pytest.mark.parametrize(("text", "code", "words"), REFUSED)
def test_what_is_refused(deck_of: DeckOf, text: str, code: str, words: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        built(deck_of, PLATE + "PCOMP,8\n,1,.1\n" + text)
    assert code in str(caught.value)
    assert words in str(caught.value)
