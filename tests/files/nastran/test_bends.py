"""CBEND: quarter arcs against Castigliano's theorem, the rules of GEOM, and rings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import rigid_body_modes
from femtune.fem.structure import Structure
from femtune.files.nastran import Deck
from femtune.files.nastran.build import build_structure

from .solving import frequencies

DeckOf = Callable[..., Deck]
R, E, NU, A, I1, I2, J = 2.0, 2e11, 0.3, 1e-3, 3e-6, 2e-6, 4e-6
G = E / 2 / (1 + NU)
MATERIAL = "MAT1,1,2.+11,,.3,7850.\n"
SECTION = "PBEND,4,1,1.-3,3.-6,2.-6,4.-6,{rb},{theta}\n,,,,,,,,\n,{k1},{k2}\n"
# a quarter circle about the origin from (R, 0) to (0, R)
POINTS = "GRID,1,,2.,0.,0.\nGRID,2,,0.,2.,0.\nGRID,3,,0.,0.,0.\nGRID,4,,3.,3.,0.\n"
RULES = {
    "centre": ("CBEND,7,4,1,2,3,,,1", "", ""),
    "tangent": ("CBEND,7,4,1,2,0.,1.,0.,2", "", ""),
    "radius": ("CBEND,7,4,1,2,4,,,3", "2.", ""),
    "angle": ("CBEND,7,4,1,2,4,,,4", "", "90."),
}


def _arc(deck_of: DeckOf, rule: str, k1: str = "", k2: str = "") -> Structure:
    card, rb, theta = RULES[rule]
    text = POINTS + MATERIAL + SECTION.format(rb=rb, theta=theta, k1=k1, k2=k2) + card + "\n"
    return build_structure(deck_of(text, name=f"{rule}{k1}{k2}.bdf")).structure


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(("k1", "k2"), [("", ""), (".8", ".6")])
def test_a_quarter_arc(deck_of: DeckOf, rule: str, k1: str, k2: str) -> None:
    structure = _arc(deck_of, rule, k1, k2)
    flexibility = np.linalg.inv(assemble(structure, "stiffness").toarray()[6:12, 6:12])
    one, other = (1 / (float(k) * G * A) if k else 0.0 for k in (k1, k2))
    quarter = np.pi / 4
    expected = {
        (1, 1): R**3 * quarter / (E * I1) + R * quarter * (1 / (E * A) + one),
        (0, 0): R**3 * (3 * quarter - 2) / (E * I1) + R * quarter * (1 / (E * A) + one),
        (0, 1): R**3 * 0.5 / (E * I1) + 0.5 * R * (one - 1 / (E * A)),
        (5, 5): R * 2 * quarter / (E * I1),
        (1, 5): -(R**2) / (E * I1),
        (2, 2): R**3 * (quarter / (E * I2) + (3 * quarter - 2) / (G * J)) + 2 * quarter * R * other,
        (3, 3): R * quarter * (1 / (E * I2) + 1 / (G * J)),
        (3, 4): 0.5 * R * (1 / (E * I2) - 1 / (G * J)),
    }
    for (i, j), value in expected.items():
        np.testing.assert_allclose(flexibility[i, j], value, rtol=1e-9, err_msg=f"{i}{j}")


def test_rigid_motions_strain_nothing(deck_of: DeckOf) -> None:
    structure = _arc(deck_of, "tangent", ".8", ".8")
    K, modes = assemble(structure, "stiffness").toarray(), rigid_body_modes(structure.nodes)
    assert np.abs(K @ modes).max() < 1e-9 * np.abs(K).max()


def test_a_flat_arc_is_a_bar(deck_of: DeckOf) -> None:
    angle = 1e-4
    ends = [f"GRID,{n},,{x:.12f},{y:.12f},0.\n" for n, (x, y) in enumerate(((0.0, 0.0), (1.0, 0.0)), 1)]
    text = "".join(ends) + MATERIAL + SECTION.format(rb=f"{0.5 / np.sin(angle / 2):.6f}", theta="", k1="", k2="")
    bend = build_structure(deck_of(text + "CBEND,7,4,1,2,0.,1.,0.,3\n", name="a.bdf")).structure
    bar = MATERIAL + "PBAR,4,1,1.-3,3.-6,2.-6,4.-6\nCBAR,7,4,1,2,0.,1.,0.\n"
    straight = build_structure(deck_of("".join(ends) + bar, name="b.bdf")).structure
    found, expected = (assemble(s, "stiffness").toarray() for s in (bend, straight))
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("n", [24, 48])
def test_rings(deck_of: DeckOf, n: int) -> None:
    """A free thin ring of round section, in and out of its plane (Love's formulas)."""
    at = 2 * np.pi * np.arange(n) / n
    lines = [f"GRID,{i + 1},,{R * np.cos(a):.10f},{R * np.sin(a):.10f},0.\n" for i, a in enumerate(at)]
    lines += ["GRID,99,,0.,0.,0.\n", MATERIAL, "PBEND,4,1,1.-3,1.-7,1.-7,2.-7\n"]
    lines += [f"CBEND,{i + 1},4,{i + 1},{(i + 1) % n + 1},99,,,1\n" for i in range(n)]
    found = frequencies(build_structure(deck_of("".join(lines))).structure)
    base = np.sqrt(E * 1e-7 / (7850.0 * A * R**4)) / (2 * np.pi)
    inside = [base * np.sqrt(k**2 * (k**2 - 1) ** 2 / (k**2 + 1)) for k in (2, 3)]
    outside = [base * np.sqrt(k**2 * (k**2 - 1) ** 2 / (k**2 + 1 + NU)) for k in (2, 3)]
    expected = np.sort(np.repeat([*inside, *outside], 2))
    elastic = found[found > 0.1 * base]
    np.testing.assert_allclose(elastic[:8], expected, rtol=0.02 * (24 / n) ** 2)


@pytest.mark.parametrize(
    ("card", "rb", "theta"),
    [
        ("CBEND,7,4,1,2,-1.,1.,0.,1", "", ""),  # along the chord
        ("CBEND,7,4,1,2,4,,,3", "1.", ""),  # less than half of the chord
        ("CBEND,7,4,1,2,4,,,4", "", "400."),
        ("CBEND,7,4,1,2,4,,,5", "", ""),
    ],
)
def test_impossible_arcs(deck_of: DeckOf, card: str, rb: str, theta: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + MATERIAL + SECTION.format(rb=rb, theta=theta, k1="", k2="") + card + "\n"))
    assert caught.value.code in ("deck.orientation", "deck.section")


@pytest.mark.parametrize(
    ("card", "words"),
    [("CBEND,7,4,1,2,4,,,3", "radius of a curved bar is 0.05"), ("CBEND,7,4,1,1,4,,,1", "at one place")],
)
def test_messages_of_impossible_arcs(deck_of: DeckOf, card: str, words: str) -> None:
    text = POINTS + MATERIAL + SECTION.format(rb=".05", theta="", k1="", k2="")
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(text + card + "\n"))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    "card", ["PBEND,4,1,2,.1,.01", "PBEND,4,1,1.-3,3.-6,2.-6", "PBEND,4,1,1.-3,3.-6,2.-6,4.-6\n,\n,,,,,,.1"]
)
def test_impossible_sections(deck_of: DeckOf, card: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        build_structure(deck_of(POINTS + MATERIAL + card + "\nCBEND,7,4,1,2,3,,,1\n"))
    assert caught.value.code == "deck.section"
