"""Cards of rigid elements: their fields, lists of any length, words in any field, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.checks import rigid_body_modes
from femtune.fem.constraints import WeightedPoints, average_rows
from femtune.fem.structure import ConstraintRows, NodeTable, Structure
from femtune.files.nastran import Deck, build_structure

from .solving import frequencies, reduced

DeckOf = Callable[..., Deck]
POINTS = "".join(
    f"GRID,{n},,{x},{y},{z},{cd}\n"
    for n, x, y, z, cd in [
        (1, 0.0, 0.0, 0.0, 0), (2, 1.0, 0.1, 0.0, 5), (3, 1.1, 1.2, 0.3, 0), (4, 0.1, 1.0, 0.4, 5),
        (5, 0.5, 0.4, 1.5, 0), (6, 0.7, 0.6, -0.8, 5), (7, 1.6, 0.6, 0.2, 0), (9, 0.4, 0.5, 0.6, 5),
    ]
) + "CORD2R,5,,0.,0.,0.,.3,.4,1.\n,1.,.2,0.\n"  # fmt: skip


def built(deck_of: DeckOf, cards: str) -> Structure:
    return build_structure(deck_of(POINTS + cards)).structure


def matrix(rows: ConstraintRows, n_dofs: int) -> np.ndarray:
    out = np.zeros((n_dofs, n_dofs))
    at = rows.dependent[rows.row]
    np.add.at(out, (at, rows.dof), rows.coefficient)
    return out


def average(table: NodeTable, components: tuple[int, ...], *groups: WeightedPoints) -> np.ndarray:
    return matrix(average_rows(table, 9, components, groups, 40), table.n_dofs)


RBE3 = {
    "one group": ("RBE3,40,,9,123456,1.,123,1,2\n,3,4,5\n", [(1.0, (1, 2, 3), (1, 2, 3, 4, 5))]),
    "blanks at the end of a list": (
        "RBE3,40,,9,123456,1.,123,1,2\n,3,,,,,,,\n,2.5,12,4,,,,,\n,.5,123456,6\n",
        [(1.0, (1, 2, 3), (1, 2, 3)), (2.5, (1, 2), (4,)), (0.5, (1, 2, 3, 4, 5, 6), (6,))],
    ),
    "THRU": ("RBE3,40,,9,123456,1.,123,1,THRU\n,5,4.7,1,6,7\n", [(1.0, (1, 2, 3), range(1, 6)), (4.7, (1,), (6, 7))]),
    "a group that starts in the last field": (
        "RBE3,40,,9,123456,1.,123,1,3\n,5,4.7,1,2,4,6,5.2,2\n,7\n",
        [(1.0, (1, 2, 3), (1, 3, 5)), (4.7, (1,), (2, 4, 6)), (5.2, (2,), (7,))],
    ),
    "thermal expansion": ("RBE3,40,,9,123456,1.,123,1,2\n,3,4\n,ALPHA,1.2-5,20.\n", [(1.0, (1, 2, 3), (1, 2, 3, 4))]),
    "thermal expansion in the middle of a line": (
        "RBE3,40,,9,123456,1.,123,1,2\n,3,4,ALPHA,1.2-5\n", [(1.0, (1, 2, 3), (1, 2, 3, 4))]
    ),
    "large field": (
        "RBE3*   40                              9               123456\n"
        "*       1.              123             1               2\n"
        "*       3               4\n*\n",
        [(1.0, (1, 2, 3), (1, 2, 3, 4))],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", RBE3)
def test_rbe3_lists(deck_of: DeckOf, name: str) -> None:
    card, groups = RBE3[name]
    structure = built(deck_of, card)
    expected = average(structure.nodes, (1, 2, 3, 4, 5, 6), *(WeightedPoints(*group) for group in groups))
    np.testing.assert_array_equal(matrix(structure.rigid, structure.nodes.n_dofs), expected)
    assert set(structure.rigid.owner.tolist()) == {40}
    assert structure.element_kinds == {40: "RBE3"}


@pytest.mark.parametrize(
    "um",
    [
        ",UM,9,14,5,3,7,2\n",
        ",UM,9,14,5,3\n,,7,2\n",
        ",ALPHA,6.5-6,UM,9,14\n,5,3,7,2\n",
        ",UM,9,14,5,3,7,2\n,ALPHA,6.5-6\n",
    ],
)
def test_the_example_of_the_handbook_with_other_dependents(deck_of: DeckOf, um: str) -> None:
    """Four components are dependent, two of them at the averaged points; the constraint stays the same."""
    lists = "RBE3,40,,9,1234,1.,123,1,3\n,5,4.7,1,2,4,6,5.2,2\n,7\n"
    plain, moved = (built(deck_of, lists + more) for more in ("", um))
    n = plain.nodes
    dofs = [n.dof(node, c) for node, c in ((9, 1), (9, 4), (5, 3), (7, 2))]
    assert sorted(moved.rigid.dependent.tolist()) == sorted(dofs)
    spaces = [matrix(s.rigid, n.n_dofs) for s in (plain, moved)]
    assert np.linalg.matrix_rank(np.vstack(spaces), tol=1e-10) == 4


OTHERS = {
    "RBE1,40,1,123456\n,UM,2,123456,4,123\n": 9,
    "RBE1,40,1,123,3,23,5,3\n,UM,7,123456\n": 6,
    "RBE1,40,1,12,3,2,5,3\n,,7,3,7,1\n,UM,9,123,6,3\n,,4,1,2.-5\n": None,
    "RBE1,40,1,123456,,,,,\n,,,,,,,,\n,UM,2,123456,1.2-5,20.\n": 6,
    "RBAR1,40,1,2\n": 6,
    "RBAR1,40,1,2,123,6.5-6\n": 3,
    "RBAR,40,1,2,123456\n": 6,
    "RTRPLT,40,1,3,5,123,23,3\n": 12,
    "RTRPLT,40,1,2,4,123456,,,\n,,123,12\n": 5,
    "RTRPLT1,40,1,2,4,123,3,6.-6\n": 4,
    "RTRPLT1,40,1,2,4\n": 12,
    "RROD,40,1,2,1\n": 1,
    "RROD,40,1,2,,3,1.2-5\n": 1,
}


@pytest.mark.parametrize("card", [c for c, n in OTHERS.items() if n is not None])
def test_other_rigid_elements_admit_rigid_motion(deck_of: DeckOf, card: str) -> None:
    structure = built(deck_of, card)
    assert len(structure.rigid) == OTHERS[card]
    full = matrix(structure.rigid, structure.nodes.n_dofs)
    assert np.abs(full @ rigid_body_modes(structure.nodes)).max() < 1e-12


def test_too_few_independent_components_are_refused(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError) as caught:
        built(deck_of, "RBE1,40,1,12,3,2,5,3\n,UM,9,123,6,3\n")
    assert caught.value.code == "constraint.rigid-independent"
    assert "(RBE1 40)" in str(caught.value)
    assert "deck.bdf:11" in str(caught.value)


REFUSED = {
    "RBE3,40,,9,123456,1,123,1,2\n": ("deck.not-a-real", "field = 6"),
    "RBE3,40,,9,,1.,123,1,2\n": ("deck.field-value", "field = 5"),
    "RBE3,40,,9,123,1.,,1,2\n": ("deck.field-value", "components"),
    "RBE3,40,,9,123,1.,123\n": ("deck.field-value", "no grid points"),
    "RBE3,40,,9,123,1.,123,1,88\n": ("deck.unknown-grid", "grid point 88"),
    "RBE3,40,,9,123,1.,123,1,2\n,3,UM,9,12,88,1\n": ("deck.unknown-grid", "grid point 88"),
    "RBE3,40,,9,123,1.,123,1,2\n,3,2,1.,12,3,UM\n": ("constraint.twice-in-element", "component 1 of grid point 2"),
    "RBE3,40,,9,123,1.,123,1,2\n,3,4,UM,9,12,1\n": ("deck.field-value", "components"),
    "RBE3,40,,9,123,1.,123,1,2\n,3,4,ALPHA\n": ("deck.blank-field", "field"),
    "RBE3,40,,9,123,1.,123,1,2\n,3,4,UX,9,1\n": ("deck.list", "UX"),
    "RBE3,40,,9,123,1.,123,1,2\n,3,4,ALPHA,1.,2.,3,4\n": ("deck.field-value", "UM, ALPHA"),
    "RBE1,40,1,123456\n": ("deck.field-value", "no dependent"),
    "RBE1,40,1,123456\n,UM,2\n": ("deck.field-value", "components"),
    "RBE1,40,1,123456\n,UM,88,1\n": ("deck.unknown-grid", "grid point 88"),
    "RTRPLT,40,1,1,5,123456\n": ("constraint.own-node", "grid point 1"),
    "RBAR1,40,2,2\n": ("constraint.own-node", "grid point 2"),
    "RROD,40,1,2\n": ("deck.field-value", "one dependent translation"),
    "RROD,40,1,2,1,2\n": ("deck.field-value", "one dependent translation"),
    "RROD,40,1,2,4\n": ("deck.field-value", "one dependent translation"),
    "RROD,40,3,3,1\n": ("element.zero-length", "same place"),
}


@pytest.mark.parametrize("card", REFUSED)
def test_refusals_name_the_card(deck_of: DeckOf, card: str) -> None:
    code, says = REFUSED[card]
    with pytest.raises(FemtuneError, match=says) as caught:
        built(deck_of, card)
    assert caught.value.code == code
    assert "40)" in str(caught.value)


def test_expansion_is_named_once(deck_of: DeckOf) -> None:
    cards = "RBE3,40,,9,123,1.,123,1,2\n,3,ALPHA,1.-5\nRBAR,41,1,7,123456,,,,1.-5\nRBE2,42,3,123,6\n"
    notices = [n for n in build_structure(deck_of(POINTS + cards)).notices if n.code == "deck.rigid-expansion"]
    assert [n.what.split()[:3] for n in notices] == [["2", "rigid", "elements"]]


FRAME = """CBAR,11,1,1,2,.3,1.,.2
CBAR,12,1,2,3,.3,.2,1.
CBAR,13,1,3,4,.3,.2,1.
CBAR,14,1,4,1,.3,.2,1.
PBAR,1,1,1.-3,2.-6,2.-6,4.-6
MAT1,1,2.1+11,,.3,7850.
CONM2,21,9,,25.
SPC1,1,123456,1
"""
HEAD, TAIL = "SOL 103\nCEND\nSPC=1\nBEGIN BULK\n", "ENDDATA\n"


def test_a_mass_on_an_rbe3_is_the_mass_spread_over_its_points(deck_of: DeckOf) -> None:
    """A translational mass at the weighted centre of the points moves with their mean: M = m w wᵀ, of rank three."""
    at_centre = POINTS.replace("GRID,9,,0.4,0.5,0.6,5", "GRID,9,,0.55,0.575,0.175,5")
    model = build_structure(deck_of(HEAD + at_centre + FRAME + "RBE3,40,,9,123456,1.,123,1,2\n,3,4\n" + TAIL))
    bare = build_structure(
        deck_of(HEAD + at_centre + FRAME.replace("25.", "0.") + "RBE3,40,,9,123456,1.,123,1,2\n,3,4\n" + TAIL)
    )
    added = reduced(model.structure)[1] - reduced(bare.structure)[1]
    values = np.linalg.eigvalsh(added)
    # the held point 1 has a share too: three points of four move
    np.testing.assert_allclose(values[-3:], 25.0 * 3 / 16, rtol=1e-10)
    assert np.abs(values[:-3]).max() < 1e-10


@pytest.mark.quick(0)
@pytest.mark.parametrize(
    "rigid",
    [
        "RBE3,40,,9,123456,1.,123,1,2\n,3,4,2.,123456,3\n".replace(",2.,123456,3", ""),
        "RBE3,40,,9,123456,1.,123456,2,3\n,4\n",
        "RBE1,40,2,123456\n,UM,9,123456\n",
        "RTRPLT1,40,3,4,9\n",
        "RROD,40,3,9,,3\nRBAR1,41,2,9,12\n",
    ],
)  # fmt: skip
def test_displacement_systems_change_no_frequency(deck_of: DeckOf, rigid: str) -> None:
    """Ten draws of displacement systems; offsets of the rigid elements are of any direction."""
    found = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        text = POINTS if seed else POINTS.replace(",5\n", ",\n")
        axes = [",".join(f"{x:.4f}" for x in rng.normal(size=3)) for _ in range(2)]
        text = text.replace(".3,.4,1.\n,1.,.2,0.", f"{axes[0]}\n,{axes[1]}") if seed else text
        # orientation vectors are in the displacement system of end A: points 1 and 3 keep the basic one, 2 and 4 get it
        text = text.replace("GRID,2,,1.0,0.1,0.0,5", "GRID,2,,1.0,0.1,0.0,0").replace(
            "GRID,4,,0.1,1.0,0.4,5", "GRID,4,,0.1,1.0,0.4,0"
        )
        partial = "RROD" in rigid
        text = text.replace("GRID,9,,0.4,0.5,0.6,5", "GRID,9,,0.4,0.5,0.6,0") if partial else text
        if partial:
            text = text.replace("GRID,3,,1.1,1.2,0.3,0", f"GRID,3,,1.1,1.2,0.3,{5 if seed else 0}")
            frame = FRAME.replace("CBAR,13,1,3,4,.3,.2,1.", "CBAR,13,1,4,3,.3,.2,1.")
        else:
            frame = FRAME
        found.append(frequencies(build_structure(deck_of(HEAD + text + frame + rigid + TAIL)).structure)[:8])
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-8)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("CRIGD1,40,1,2,3\n", "RBE2,40,1,123456,2,3\n"),
        ("CRIGD1,40,1,2,THRU,5\n", "RBE2,40,1,123456,2,3,4,5\n"),
        ("CRIGD2,40,1,2,123456,3,12\n", "RBE1,40,1,123456\n,UM,2,123456,3,12\n"),
        ("CRIGD3,40,1,12,3,2,5,3\n,,7,3,7,1\n,MSET,9,123,6,3\n", "RBE1,40,1,12,3,2,5,3\n,,7,3,7,1\n,UM,9,123,6,3\n"),
        ("CRIGDR,40,1,2,3\n", "RROD,40,1,2,,3\n"),
    ],
)
def test_rigid_elements_of_nastran_95_are_those_of_today(deck_of: DeckOf, old: str, new: str) -> None:
    rows = [built(deck_of, card).rigid for card in (old, new)]
    n = built(deck_of, new).nodes.n_dofs
    np.testing.assert_allclose(matrix(rows[0], n), matrix(rows[1], n), atol=1e-14)


def test_their_numbers_are_unique_within_a_kind(deck_of: DeckOf) -> None:
    structure = built(deck_of, "CRIGD1,40,1,2\nCRIGD2,40,3,4,123\n")
    assert len(structure.rigid.dependent) == 9
    with pytest.raises(FemtuneError) as caught:
        built(deck_of, "CRIGD1,40,1,2\nCRIGD1,40,3,4\n")
    assert caught.value.code == "deck.duplicate-id"


@pytest.mark.parametrize(
    "card", ["CRIGD1,40,1\n", "CRIGD2,40,1\n", "CRIGDR,40,1,2\n", "CRIGDR,40,1,2,4\n", "CRIGD3,40,1,123456\n"]
)
def test_incomplete_rigid_elements_of_nastran_95(deck_of: DeckOf, card: str) -> None:
    with pytest.raises(FemtuneError) as caught:
        built(deck_of, card)
    assert caught.value.code == "deck.field-value"
