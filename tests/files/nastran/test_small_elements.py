"""Rods, springs, bushes, masses, rigid elements and multipoint constraints."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.checks import mass_properties, rigid_body_modes
from femtune.fem.structure import ConstraintRows, ElementBatch
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure

from .solving import frequencies

DeckOf = Callable[..., Deck]
CYLINDER = "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
POINTS = CYLINDER + "GRID,1,,0.,0.,0.\nGRID,2,,0.,2.,0.,5\nGRID,3,,3.,0.,4.,5\n"


def batches(deck: Deck) -> tuple[BuiltDeck, tuple[ElementBatch, ...]]:
    model = build_structure(deck)
    return model, model.structure.batches


def values(model: BuiltDeck, one: ElementBatch, i: int = 0) -> dict[str, float]:
    return {role: float(model.structure.values.values[at[i]]) for role, at in one.roles.items()}


def test_rods(deck_of: DeckOf) -> None:
    text = POINTS + "MAT1,1,2.,1.,,3.,,,.02\nPROD,4,1,.5,.1,,.2\nCROD,7,4,1,2\nCONROD,8,2,3,1,.6,.3,,.4\n"
    model, (rod, own) = batches(deck_of(text))
    shared = {"E": 2.0, "G": 1.0, "rho": 3.0, "GE": 0.02}
    assert values(model, rod) == {**shared, "A": 0.5, "J": 0.1, "NSM": 0.2}
    assert values(model, own) == {**shared, "A": 0.6, "J": 0.3, "NSM": 0.4}
    assert (rod.card, own.card, own.dofs.tolist()) == ("CROD", "CONROD", [list(range(6, 18))])


def test_scalar_springs_and_masses(deck_of: DeckOf) -> None:
    text = (
        "SPOINT,50\nPELAS,3,10.,,,4,20.\nCELAS1,1,4,1,2,3,6\nCELAS2,2,30.,2,3\nCELAS2,3,40.,50,,1,1\n"
        "PMASS,8,1.5,9,2.5\nCMASS1,4,9,1,1\nCMASS2,5,3.5,50,,50\n"
    )
    model, (a, b, c, d) = batches(deck_of(POINTS + text))
    found = [values(model, a), values(model, b), values(model, b, 1)]
    assert found == [{"K": k, "GE": 0.0} for k in (20.0, 30.0, 40.0)]
    assert (a.dofs.tolist(), a.nodes.tolist()) == ([[1, 17]], [[0, 2]])
    assert (b.dofs.tolist(), b.nodes.tolist()) == ([[8, -1], [18, 0]], [[1, -1], [-1, 0]])
    assert [c.kind, values(model, c), values(model, d)] == ["scalar-mass", {"M": 2.5}, {"M": 3.5}]


def test_bush_axes_and_arms(deck_of: DeckOf) -> None:
    text = POINTS + (
        "PBUSH,9,K,1.,2.,3.,4.,5.,6.\n"
        "CBUSH,1,9,1,3,0.,1.,0.\nCBUSH,2,9,2,3,,,,5\n,.25\nCBUSH,3,9,2,,,,,0\nCBUSH,4,9,1,3,2\n,,5,2.,90.,1.\n"
    )
    model, (one,) = batches(deck_of(text))
    found = values(model, one)
    assert {name: found.pop(name) for name in list(found) if name[0] == "K"} == {f"K{i}": i for i in range(1, 7)}
    assert set(found.values()) == {0.0}
    frame, a, b = one.facts["frame"], one.facts["arm_a"], one.facts["arm_b"]
    np.testing.assert_allclose(frame[0], [[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]], atol=1e-15)
    np.testing.assert_allclose((a[0], b[0]), [[1.5, 0, 2], [-1.5, 0, -2]])
    # cylindrical axes at point 2, which lies on basic y; a quarter of the way to point 3
    np.testing.assert_allclose(frame[1], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose((a[1], b[1]), [[0.75, -0.5, 1], [-2.25, 1.5, -3]])
    assert (one.nodes[2].tolist(), one.dofs[2].tolist()) == ([1, -1], [*range(6, 12), *[-1] * 6])
    np.testing.assert_allclose((a[3], b[3]), [[0, 2, 1], [-3, 2, -3]], atol=1e-15)


def test_stiffnesses_of_a_bush_may_stand_on_a_later_line(deck_of: DeckOf) -> None:
    text = POINTS + "PBUSH,9,B,7.,8.\n,,K,,2.\nCBUSH,1,9,1,3,0.,1.,0.\n"
    model, (one,) = batches(deck_of(text))
    assert {name: x for name, x in values(model, one).items() if x} == {"K2": 2.0, "B1": 7.0, "B2": 8.0}


def test_axial_bush_needs_no_orientation(deck_of: DeckOf) -> None:
    _, (one,) = batches(deck_of(POINTS + "PBUSH,9,K,5.\nCBUSH,1,9,1,3\n"))
    np.testing.assert_allclose(one.facts["frame"][0][:, 0], [0.6, 0, 0.8])


def test_mass_offset_in_a_cylindrical_system_and_as_a_point(deck_of: DeckOf) -> None:
    text = "CONM2,1,2,5,4.,.1,.2,.3\n,1.,,2.,,,3.\nCONM2,2,2,-1,4.,.1,.2,.3\n"
    model, (one,) = batches(deck_of(POINTS + text))
    np.testing.assert_allclose(one.facts["offset"], [[-0.2, 0.1, 0.3], [0.1, -1.8, 0.3]], atol=1e-15)
    assert values(model, one) == {"M": 4.0, "I11": 1.0, "I21": 0.0, "I22": 2.0, "I31": 0.0, "I32": 0.0, "I33": 3.0}
    about = mass_properties(model.structure.nodes, assemble(model.structure, "mass"))
    np.testing.assert_allclose(about.centre, [-0.05, 1.15, 0.3], atol=1e-14)


def test_general_mass_is_the_lower_triangle_in_its_frame(deck_of: DeckOf) -> None:
    text = "GRID,1,,0.,2.,0.\n" + CYLINDER + "CONM1,1,1,5,1.,.1,2.\n,3.,,,,.7\n"
    model, (one,) = batches(deck_of(text))
    assert values(model, one)["M21"] == 0.1
    assert values(model, one)["M44"] == 0.7
    mass = assemble(model.structure, "mass").toarray()
    # e_r is basic y and e_θ is −x at this point
    np.testing.assert_allclose(mass[:2, :2], [[2.0, -0.1], [-0.1, 1.0]], atol=1e-15)
    np.testing.assert_allclose(np.diag(mass)[2:], [3.0, 0.0, 0.7, 0.0], atol=1e-15)


def dense(rows: ConstraintRows, n: int) -> np.ndarray:
    out = np.zeros((len(rows), n))
    np.add.at(out, (rows.row, rows.dof), rows.coefficient)
    return out


@pytest.mark.parametrize("line", ["RBE2,9,1,123456,2,3\n", "RBE2,9,1,123456,2,THRU,3\n", "RBE2,9,1,123456,2,3,1.-5\n"])
def test_rigid_element_allows_every_rigid_motion_in_turned_frames(deck_of: DeckOf, line: str) -> None:
    model = build_structure(deck_of(POINTS + line))
    rows = dense(model.structure.rigid, 18)
    assert model.structure.rigid.dependent.tolist() == list(range(6, 18))
    np.testing.assert_allclose(rows @ rigid_body_modes(model.structure.nodes), 0.0, atol=1e-14)
    assert model.structure.element_kinds == {9: "RBE2"}


def test_components_of_a_rigid_element_are_those_of_the_dependents(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(POINTS + "RBE2,9,1,1,2\n"))
    # radial displacement at point 2 is basic y: y of point 1, and its rotations about z (arm 2 along y: none)
    np.testing.assert_allclose(dense(model.structure.rigid, 18)[0, :8], [0, -1, 0, 0, 0, 0, 1, 0], atol=1e-15)


def test_rigid_bar(deck_of: DeckOf) -> None:
    model = build_structure(deck_of(POINTS + "RBAR,9,1,3,123456\nRBAR,8,1,2,123,456\n"))
    np.testing.assert_allclose(
        dense(model.structure.rigid, 18) @ rigid_body_modes(model.structure.nodes), 0.0, atol=1e-14
    )
    assert model.structure.rigid.owner.tolist() == [9] * 6 + [8] * 6


def test_multipoint_constraints(deck_of: DeckOf) -> None:
    text = POINTS + "SPOINT,50\nMPC,1,1,3,1.,2,1,-2.,\n,,50,,3.,3,2,4.\nMPC,2,50,,1.,1,1,-1.\nMPCADD,7,1,2\n"
    sets = build_structure(deck_of(text)).structure.multipoint_sets
    row = dense(sets[1], 19)[0]
    assert {int(i): row[i] for i in np.flatnonzero(row)} == {2: 1.0, 6: -2.0, 18: 3.0, 13: 4.0}
    assert sets[1].dependent.tolist() == [2]
    assert sets[7].dependent.tolist() == [2, 18]


def test_mass_on_a_rigid_arm_swings_as_a_pendulum_on_a_torsion_spring(deck_of: DeckOf) -> None:
    text = (
        f"SOL 103\nCEND\nSPC=1\nBEGIN BULK\n{CYLINDER}GRID,1,,0.,0.,0.\nGRID,2,,3.,4.,0.,5\nRBE2,9,1,123456,2\n"
        "CONM2,2,2,,7.\nCELAS2,3,11.,1,6\nSPC1,1,12345,1\nENDDATA\n"
    )
    found = frequencies(build_structure(deck_of(text)).structure)
    assert found == pytest.approx([np.sqrt(11.0 / (7.0 * 25.0)) / (2 * np.pi)])


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("CELAS2,1,5.,1\n", "deck.field-value"),
        ("CELAS2,1,5.,1,12\n", "deck.field-value"),
        ("CELAS2,1,5.\n", "deck.field-value"),
        ("CELAS2,1,5.,99,3\n", "deck.unknown-grid"),
        ("CELAS1,1,5,1,3\n", "deck.unknown-property"),
        ("CONM2,1,99,,5.\n", "deck.unknown-grid"),
        ("CONM2,1,1,6,5.\n", "deck.unknown-coordinate-system"),
        ("RBE2,1,1,123456,99\n", "deck.unknown-grid"),
        ("RBE2,1,1,,2\n", "deck.field-value"),
        ("RBE2,1,1,123456\n", "deck.field-value"),
        ("RBE2,1,1,123456,1\n", "constraint.own-node"),
        ("RBAR,1,1,2,123\n", "constraint.rigid-independent"),
        ("MPC,1,1,3,0.,2,1,1.\n", "deck.field-value"),
        ("MPC,1,1,34,1.,2,1,1.\n", "deck.field-value"),
        ("CBUSH,1,9,1,2\nPBUSH,9,K,1.,2.\n", "deck.orientation"),
        ("CBUSH,1,9,1\nPBUSH,9,K,1.\n", "deck.orientation"),
        ("CBUSH,1,9,1,2,,,,0\nPBUSH,9,Q,1.\n", "deck.field-value"),
        ("CBUSH,1,9,1,2,,,,0\nPBUSH,9,K,1.\n,,M,1.\n", "deck.section"),
        ("CROD,1,9,1,1\nPROD,9,1,1.\nMAT1,1,1.,,.3\n", "deck.zero-length"),
        ("CONROD,1,1,2,6,1.\n", "deck.unknown-material"),
    ],
)
def test_errors(deck_of: DeckOf, line: str, expected: str) -> None:
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(POINTS + line))
    assert error.value.code == expected
    assert error.value.where is not None
    assert error.value.where.line is not None
    assert error.value.where.line > 5
