"""Loss factors and dashpots of decks: what each card means, as matrices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure

DeckOf = Callable[..., Deck]
CYLINDER = "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
POINTS = CYLINDER + "GRID,1,,0.,0.,0.\nGRID,2,,0.,2.,0.,5\nGRID,3,,3.,0.,4.,5\n"


def value(model: BuiltDeck, i: int, role: str, element: int = 0) -> float:
    batch = model.structure.batches[i]
    return float(model.structure.values.values[batch.roles[role][element]])


def dense(model: BuiltDeck, matrix: str) -> np.ndarray:
    return assemble(model.structure, matrix).toarray()  # type: ignore[arg-type]


def test_scalar_dashpots_are_springs_that_feel_velocity(deck_of: DeckOf) -> None:
    """The same card with C for K in its name gives the same matrix."""
    springs = (
        "SPOINT,50,51\nPELAS,3,10.,,,4,20.\nCELAS1,1,4,1,2,3,6\nCELAS2,2,30.,2,3\nCELAS2,3,40.,50,,1,1\n"
        "CELAS3,4,3,50,51\nCELAS4,5,7.,51\n"
    )
    dampers = springs.replace("PELAS,3,10.,,,4,20.", "PDAMP,3,10.,4,20.").replace("CELAS", "CDAMP")
    model = build_structure(deck_of(POINTS + dampers))
    expected = dense(build_structure(deck_of(POINTS + springs)), "stiffness")
    np.testing.assert_array_equal(dense(model, "viscous"), expected)
    assert not dense(model, "stiffness").any()
    assert expected[18, 19] == -10.0
    assert expected[19, 19] == 17.0
    assert model.structure.nodes.scalar_points.tolist() == [50, 51]


def test_scalar_springs_and_masses_of_scalar_points(deck_of: DeckOf) -> None:
    """CELAS3, CELAS4, CMASS3 and CMASS4 make the points that they name, as Nastran does."""
    text = "PELAS,3,10.,.1\nCELAS3,1,3,7,8\nCELAS4,2,4.,8\nPMASS,3,2.\nCMASS3,3,3,7\nCMASS4,4,5.,,8\n"
    model = build_structure(deck_of(text))
    assert model.structure.nodes.scalar_points.tolist() == [7, 8]
    np.testing.assert_array_equal(dense(model, "stiffness"), [[10.0, -10.0], [-10.0, 14.0]])
    np.testing.assert_array_equal(dense(model, "mass"), [[2.0, 0.0], [0.0, 5.0]])
    np.testing.assert_array_equal(dense(model, "hysteretic"), [[1.0, -1.0], [-1.0, 1.0]])


def test_a_viscous_rod_is_a_rod(deck_of: DeckOf) -> None:
    """CVISC with CE = E·A/l and CR = G·J/l is the matrix of a rod, in any displacement frames (l = 5)."""
    rod = build_structure(deck_of(POINTS + "MAT1,1,5.,10.\nCONROD,1,1,3,1,2.,3.\n"))
    damper = build_structure(deck_of(POINTS + "PVISC,1,9.,9.,,2,2.,6.\nCVISC,1,2,1,3\n"))
    np.testing.assert_allclose(dense(damper, "viscous"), dense(rod, "stiffness"), atol=1e-14)


def test_spring_and_damper_along_a_line(deck_of: DeckOf) -> None:
    axial = build_structure(deck_of(POINTS + "PBUSH1D,4,7.,.3\nCBUSH1D,1,4,1,3\n"))
    bush = build_structure(deck_of(POINTS + "PBUSH,4,K,7.\n,,B,.3\nCBUSH,1,4,1,3\n"))
    for matrix in ("stiffness", "viscous"):
        np.testing.assert_allclose(dense(axial, matrix), dense(bush, matrix), atol=1e-14)


def test_spring_and_damper_to_ground_follow_the_axis_of_their_system(deck_of: DeckOf) -> None:
    # the radial direction of the cylindrical system at point 2 is its own first displacement
    found = dense(build_structure(deck_of(POINTS + "PBUSH1D,4,7.,.3\nCBUSH1D,1,4,2,,5\n")), "viscous")
    assert np.argwhere(np.abs(found) > 1e-14).tolist() == [[6, 6]]
    assert found[6, 6] == pytest.approx(0.3)


def test_loss_factors_of_materials_and_springs(deck_of: DeckOf) -> None:
    text = "MAT1,1,5.,10.,,,,,.02\nCONROD,1,1,3,1,2.,3.\nPELAS,3,10.,.1\nCELAS1,2,3,1,2,2,2\nCELAS2,3,4.,3,1,,,.5\n"
    model = build_structure(deck_of(POINTS + text))
    parts = [
        dense(build_structure(deck_of(POINTS + one)), "stiffness")
        for one in ("MAT1,1,5.,10.\nCONROD,1,1,3,1,2.,3.\n", "CELAS2,2,10.,1,2,2,2\n", "CELAS2,3,4.,3,1\n")
    ]
    expected = 0.02 * parts[0] + 0.1 * parts[1] + 0.5 * parts[2]
    np.testing.assert_allclose(dense(model, "hysteretic"), expected, rtol=1e-14)


def test_each_direction_of_a_bush_has_its_spring_its_damper_and_its_loss_factor(deck_of: DeckOf) -> None:
    card = "PBUSH,9,K,1.,2.,3.,4.,5.,6.\n,,B,.1,.2,.3,.4,.5,.6\n,,GE,.01,.02,,.04,.05,.06\nCBUSH,1,9,2,,,,,0\n"
    model = build_structure(deck_of("GRID,2,,0.,2.,0.\n" + card))
    np.testing.assert_allclose(np.diag(dense(model, "viscous")), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    # a blank among given loss factors is zero
    np.testing.assert_allclose(np.diag(dense(model, "hysteretic")), [0.01, 0.04, 0.0, 0.16, 0.25, 0.36])


@pytest.mark.parametrize(("line", "third"), [(",,GE,.1\n", 0.3), (",,GE,.1,0.\n", 0.0), ("", 0.0)])
def test_the_first_loss_factor_alone_is_that_of_all_directions(deck_of: DeckOf, line: str, third: float) -> None:
    text = "GRID,2,,0.,2.,0.\nPBUSH,9,K,1.,2.,3.,4.,5.,6.\n" + line + "CBUSH,1,9,2,,,,,0\n"
    assert dense(build_structure(deck_of(text)), "hysteretic")[2, 2] == pytest.approx(third)


def test_a_bush_of_damping_across_its_line_needs_its_axes(deck_of: DeckOf) -> None:
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(POINTS + "PBUSH,9,K,5.\n,,B,,2.\nCBUSH,1,9,1,3\n"))
    assert error.value.code == "deck.orientation"


def test_negative_damping_is_taken_as_it_stands(deck_of: DeckOf) -> None:
    assert dense(build_structure(deck_of(POINTS + "CDAMP2,1,-3.,1,1\n")), "viscous")[0, 0] == -3.0


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("CDAMP1,1,3,1,1\n", "deck.unknown-property", "property 3 does not exist"),
        ("PELAS,3,1.\nCDAMP1,1,3,1,1\n", "deck.property-type", "CDAMP1 needs a PDAMP"),
        ("CDAMP2,1,3.\n", "deck.field-value", "both ends"),
        ("CDAMP4,1,3.\n", "deck.field-value", "both ends"),
        ("CDAMP4,1,3.,2\n", "deck.field-value", "2 is a grid point"),
        ("PVISC,3,1.\nCVISC,1,3,1,9\n", "deck.unknown-grid", "grid point 9"),
        ("PVISC,3,1.\nCVISC,1,3,1\n", "deck.blank-field", "CVISC 1"),
        ("PVISC,3,1.\nCVISC,1,3,1,1\n", "deck.zero-length", "same point"),
        ("PBUSH1D,3,1.\nCBUSH1D,1,3,1\n", "deck.orientation", "to ground needs a coordinate system"),
        ("PBUSH1D,3,1.,,4.\nCBUSH1D,1,3,1,3\n", "deck.section", "mass of a PBUSH1D"),
    ],
)
def test_errors(deck_of: DeckOf, text: str, code: str, message: str) -> None:
    with pytest.raises(FemtuneError) as error:
        build_structure(deck_of(POINTS + text))
    assert error.value.code == code
    assert message in str(error.value)


def test_laws_that_are_not_linear_are_told(deck_of: DeckOf) -> None:
    text = "PBUSH1D,3,1.,2.\n,SHOCKA,TABLE,.5\nCBUSH1D,1,3,1,3\n"
    notices = build_structure(deck_of(POINTS + text)).notices
    assert [n.code for n in notices] == ["deck.nonlinear-damper"]
