"""CHEXA, CPENTA, CTETRA, CPYRAM and PSOLID with MAT1, MAT9 and MAT11, as batches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.files.nastran.solids import element_axes
from femtune.parameters import jet

DeckOf = Callable[..., Deck]
CYLINDER = "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
CUBE = "".join(
    f"GRID,{k + 1},,{x},{y},{z}\n"
    for k, (x, y, z) in enumerate(
        (x, y, z) for z in ("0.", "2.") for x, y in (("0.", "0."), ("2.", "0."), ("2.", "2."), ("0.", "2."))
    )
)
MIDDLES = "".join(f"GRID,{k},,{k}.,9.,9.\n" for k in range(9, 21))
POINTS = CYLINDER + CUBE + MIDDLES
STEEL = "MAT1,1,2.,,.25,3.,,,.01\n"
LUMP = "PSOLID,9,1\n"
CHEXA = "CHEXA,20,9,1,2,3,4,5,6\n,7,8"


def built(deck_of: DeckOf, text: str) -> BuiltDeck:
    return build_structure(deck_of(POINTS + text))


def batch(deck_of: DeckOf, text: str) -> tuple[BuiltDeck, ElementBatch]:
    model = built(deck_of, text)
    (one,) = model.structure.batches
    return model, one


def law(model: BuiltDeck, one: ElementBatch, i: int = 0) -> NDArray[np.float64]:
    out = np.zeros((6, 6))
    for a in range(6):
        for b in range(a, 6):
            out[a, b] = out[b, a] = model.structure.values.values[one.roles[f"C{a + 1}{b + 1}"][i]]
    return out


def value(model: BuiltDeck, one: ElementBatch, role: str) -> float:
    return float(model.structure.values.values[one.roles[role][0]])


def code_of(deck_of: DeckOf, text: str) -> FemtuneError:
    with pytest.raises(FemtuneError) as error:
        built(deck_of, text)
    return error.value


@pytest.mark.parametrize(
    ("cards", "kind", "numbers"),
    [
        (CHEXA, "hexa8", range(1, 9)),
        ("CHEXA,20,9,1,2,3,4,5,6\n,7,8,9,10,11,12,13,14\n,15,16,17,18,19,20", "hexa20", range(1, 21)),
        ("CPENTA,20,9,1,2,3,5,6,7", "penta6", [1, 2, 3, 5, 6, 7]),
        ("CPENTA,20,9,1,2,3,5,6,7\n,9,10,11,12,13,14,15,16\n,17", "penta15", [1, 2, 3, 5, 6, 7, *range(9, 18)]),
        ("CTETRA,20,9,1,2,3,5", "tetra4", [1, 2, 3, 5]),
        ("CTETRA,20,9,1,2,3,5,9,10\n,11,12,13,14", "tetra10", [1, 2, 3, 5, *range(9, 15)]),
        ("CPYRAM,20,9,1,2,3,4,5", "pyram5", [1, 2, 3, 4, 5]),
        ("CPYRAM,20,9,1,2,3,4,5,9\n,10,11,12,13,14,15,16", "pyram13", [1, 2, 3, 4, 5, *range(9, 17)]),
    ],
)
def test_shapes(deck_of: DeckOf, cards: str, kind: str, numbers: list[int]) -> None:
    _, one = batch(deck_of, STEEL + LUMP + cards + "\n")
    assert (one.kind, one.card, one.ids.tolist()) == (kind, cards.split(",", maxsplit=1)[0], [20])
    assert (one.nodes[0] + 1).tolist() == list(numbers)
    assert one.dofs[0].tolist() == [6 * (n - 1) + i for n in numbers for i in range(3)]


def test_formats_say_the_same(deck_of: DeckOf) -> None:
    small = "CHEXA   20      9       1       2       3       4       5       6       +A\n+A      7       8\n"
    large = (
        "CHEXA*                20               9               1               2\n"
        "*                      3               4               5               6\n"
        "*                      7               8\n*\n"
    )
    for text in (small, large, CHEXA + "\n"):
        _, one = batch(deck_of, STEEL + LUMP + text)
        assert (one.nodes[0] + 1).tolist() == list(range(1, 9))


@pytest.mark.parametrize("blank", ["", "0"])
def test_middles_may_be_left_out(deck_of: DeckOf, blank: str) -> None:
    _, one = batch(deck_of, STEEL + LUMP + f"CTETRA,20,9,1,2,3,5,{blank},10\n,,12\n")
    assert one.kind == "tetra10"
    assert one.nodes[0].tolist() == [0, 1, 2, 4, -1, 9, -1, 11, -1, -1]
    assert one.dofs[0][12:18].tolist() == [-1, -1, -1, 54, 55, 56]


def test_elements_with_and_without_middles_are_two_batches(deck_of: DeckOf) -> None:
    text = "CTETRA,20,9,1,2,3,5\nCTETRA,21,9,1,2,3,5,9\nCTETRA,22,9,1,2,3,6\n"
    model = built(deck_of, STEEL + LUMP + text)
    assert [(b.kind, b.ids.tolist()) for b in model.structure.batches] == [("tetra4", [20, 22]), ("tetra10", [21])]
    (notice,) = [n for n in model.notices if n.code == "deck.stiff-tetrahedra"]
    assert "2 CTETRA cards" in notice.what
    assert notice.where is not None
    assert notice.where.record == "CTETRA 20"


@pytest.mark.parametrize(
    ("cards", "what"),
    [
        ("CHEXA,20,9,1,2,3,4,5,6", "corner G7 of the element is missing"),
        ("CHEXA,20,9,1,2,3,4,5,6\n,7,,9", "corner G8 of the element is missing"),
        ("CTETRA,20,9,1,2,-3,5", "grid point must be positive"),
        ("CTETRA,20,9,1,2,3,5,-1", "grid point must be positive"),
        ("CTETRA,20,9,1,2,3,2", "grid point 2 twice"),
        ("CTETRA,20,9,1,2,3,5,9,9", "grid point 9 twice"),
        ("CTETRA,20,9,1,2,3,5,9,10\n,11,12,13,14,15", "at most 10 grid points"),
        ("CHEXA,20,9,1,2,3,3,5,6\n,7,7", "with a CPENTA"),
        ("CHEXA,20,9,1,2,3,4,5,5\n,5,5", "with a CPYRAM"),
    ],
)
def test_grid_points_that_make_no_solid(deck_of: DeckOf, cards: str, what: str) -> None:
    error = code_of(deck_of, STEEL + LUMP + cards + "\n")
    assert error.code == "deck.solid-nodes"
    assert what in str(error)


def test_unknown_grid(deck_of: DeckOf) -> None:
    assert code_of(deck_of, STEEL + LUMP + "CTETRA,20,9,1,2,3,77\n").code == "deck.unknown-grid"


def test_isotropic_law_is_the_inverse_of_its_compliance(deck_of: DeckOf) -> None:
    model, one = batch(deck_of, STEEL + LUMP + CHEXA + "\n")
    compliance = np.kron(np.diag([1.0, 0.0]), np.full((3, 3), -0.25 / 2.0)) + np.diag([1.25 / 2.0] * 3 + [1 / 0.8] * 3)
    np.testing.assert_allclose(law(model, one), np.linalg.inv(compliance), atol=1e-15)
    assert (value(model, one, "rho"), value(model, one, "GE")) == (3.0, 0.01)
    assert one.facts["isotropic"].tolist() == [True]
    np.testing.assert_array_equal(one.facts["material_frame"], np.eye(3)[None])
    assert len({int(one.roles[n][0]) for n in ("C11", "C22", "C33")}) == 1
    assert len({int(one.roles[n][0]) for n in ("C14", "C25", "C56")}) == 1


@pytest.mark.parametrize("material", ["MAT1,1,2.,,.25\n", "MAT1,1,2.,.8\n", "MAT1,1,,.8,.25\n", "MAT1,1,2.,.5,.25\n"])
def test_any_two_of_three_moduli(deck_of: DeckOf, material: str) -> None:
    """Where all three are given, E and NU count, as in the matrices of CTETRA in solid_shell_bar."""
    model, one = batch(deck_of, material + LUMP + CHEXA + "\n")
    assert [law(model, one)[i] for i in ((0, 0), (0, 1), (3, 3))] == pytest.approx([2.4, 0.8, 0.8])


def test_orthotropic_law_is_the_inverse_of_its_compliance(deck_of: DeckOf) -> None:
    e, (n12, n13, n23), (g12, g13, g23) = (140.0, 10.0, 12.0), (0.3, 0.25, 0.4), (5.0, 4.0, 3.0)
    text = f"MAT11,1,{e[0]},{e[1]},{e[2]},{n12},{n13},{n23},{g12}\n,{g13},{g23},2.,,,,,.07\n"
    model, one = batch(deck_of, text + LUMP + CHEXA + "\n")
    compliance = np.diag([1 / e[0], 1 / e[1], 1 / e[2], 1 / g12, 1 / g23, 1 / g13])
    compliance[0, 1] = compliance[1, 0] = -n12 / e[0]
    compliance[0, 2] = compliance[2, 0] = -n13 / e[0]
    compliance[1, 2] = compliance[2, 1] = -n23 / e[1]
    np.testing.assert_allclose(law(model, one), np.linalg.inv(compliance), rtol=1e-13, atol=1e-13)
    assert (value(model, one, "rho"), value(model, one, "GE")) == (2.0, 0.07)
    assert not one.facts["isotropic"][0]


def test_anisotropic_law_stands_on_the_card_in_the_order_xy_yz_zx(deck_of: DeckOf) -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    stiff = root @ root.T + np.eye(6)
    numbers = ",".join(f"{x:.6f}" for x in stiff[np.triu_indices(6)]).split(",")
    rows = [["1", *numbers[:7]], numbers[7:15], [*numbers[15:], "7.", ""], ["", "", "", "", "", "", ".05"]]
    text = "MAT9," + "\n,".join(",".join(row) for row in rows) + "\n"
    model, one = batch(deck_of, text + LUMP + CHEXA + "\n")
    np.testing.assert_allclose(law(model, one), stiff, atol=1e-6)
    assert (value(model, one, "rho"), value(model, one, "GE")) == (7.0, 0.05)
    assert model.structure.values.index(FieldRef("MAT9", 1, "G45")) is not None


@pytest.mark.parametrize(
    ("material", "what"),
    [
        ("MAT1,1,2.,,.5\n", "Poisson's ratio of 0.5"),
        ("MAT1,1,2.,.6\n", "Poisson's ratio of 0.66"),
        ("MAT1,1,2.\n", "shear modulus"),
        ("MAT9,1,2.,3.,,,,,2.\n,,,,,2.\n,1.,,,1.,,1.\n", "is not positive definite"),
        ("MAT9,1,2.,,,,,,2.\n,,,,,2.\n,1.,,,1.\n", "is not positive definite"),
        ("MAT11,1,2.,2.,2.,.6,.6,.6,1.\n,1.,1.\n", "ratios of MAT11"),
        ("MAT11,1,2.,2.,-2.,.3,.3,.3,1.\n,1.,1.\n", "E3 of a material"),
        ("MAT8,1,2.,2.,.3,1.\n", "material 1 is a MAT8"),
    ],
)
def test_materials_that_make_no_solid(deck_of: DeckOf, material: str, what: str) -> None:
    error = code_of(deck_of, material + LUMP + CHEXA + "\n")
    assert error.code in ("deck.material", "deck.material-type")
    assert what in str(error)


def test_rubber_is_a_solid(deck_of: DeckOf) -> None:
    model, one = batch(deck_of, "MAT1,1,2.,,.4999\n" + LUMP + CHEXA + "\n")
    assert law(model, one)[0, 1] == pytest.approx(2 * 0.4999 / 1.4999 / 0.0002)


def test_shells_have_no_solid_material(deck_of: DeckOf) -> None:
    text = "MAT11,1,2.,2.,2.,.3,.3,.3,1.\n,1.,1.\nPSHELL,9,1,.1\nCTRIA3,20,9,1,2,3\n"
    assert "a shell needs a MAT1" in str(code_of(deck_of, text))


@pytest.mark.parametrize(
    ("material", "name"),
    [
        *[("MAT1,1,2.,,.25\n", name) for name in ("E", "NU")],
        ("MAT1,1,2.,.8\n", "G"),
        *[
            ("MAT11,1,140.,10.,12.,.3,.25,.4,5.\n,4.,3.\n", n)
            for n in ("E1", "E2", "E3", "NU12", "NU13", "NU23", "G23")
        ],
    ],
)
def test_derived_entries_follow_a_change_of_the_card(deck_of: DeckOf, material: str, name: str) -> None:
    model, one = batch(deck_of, material + LUMP + CHEXA + "\n")
    ref = FieldRef(material.split(",", maxsplit=1)[0], 1, name)
    index = model.structure.values.index(ref)
    assert index is not None
    fields = material.replace("\n,", ",", 1).strip().split(",")
    place = model.fields[ref].fields[0] + 1
    new = float(fields[place]) * 1.1
    moved = model.structure.values.evaluate({index: jet.constant(new, 0)}, 0).value
    fields[place] = f"{new:#.8g}"
    text = ",".join(fields[:9]) + "\n," + ",".join(fields[9:]) + "\n"
    again, other = batch(deck_of, text + LUMP + CHEXA + "\n")
    for role in one.roles:
        now = again.structure.values.values[other.roles[role][0]]
        np.testing.assert_allclose(moved[one.roles[role][0]], now, rtol=1e-7, err_msg=role)


ORTHOTROPIC = "MAT11,1,140.,10.,12.,.3,.25,.4,5.\n,4.,3.\n"


def frame(deck_of: DeckOf, cordm: str, cards: str = CHEXA) -> NDArray[np.float64]:
    _, one = batch(deck_of, ORTHOTROPIC + f"PSOLID,9,1,{cordm}\n" + cards + "\n")
    return np.asarray(one.facts["material_frame"][0])


def test_material_axes_of_a_system_at_the_centre(deck_of: DeckOf) -> None:
    for cordm in ("", "0"):
        np.testing.assert_array_equal(frame(deck_of, cordm), np.eye(3))
    # the centre (1, 1, 1) lies at 45 degrees of the cylinder system
    c = 0.5**0.5
    np.testing.assert_allclose(frame(deck_of, "5"), [[c, -c, 0], [c, c, 0], [0, 0, 1]], atol=1e-15)


def test_axes_of_the_element(deck_of: DeckOf) -> None:
    np.testing.assert_allclose(frame(deck_of, "-1"), np.eye(3), atol=1e-15)
    turned = frame(deck_of, "-1", "CHEXA,20,9,2,3,4,1,6,7\n,8,5")
    np.testing.assert_allclose(turned, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    error = code_of(deck_of, ORTHOTROPIC + "PSOLID,9,1,-1\nCTETRA,20,9,1,2,3,5\n")
    assert error.code == "deck.solid-section"


def test_axes_of_a_skew_element_make_the_lines_between_its_faces_symmetric() -> None:
    corners = np.random.default_rng(3).uniform(-0.2, 0.2, (8, 3)) + np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    )
    axes = element_axes(corners)
    r = corners[[1, 2, 5, 6]].mean(axis=0) - corners[[0, 3, 4, 7]].mean(axis=0)
    s = corners[[2, 3, 6, 7]].mean(axis=0) - corners[[0, 1, 4, 5]].mean(axis=0)
    t = corners[4:].mean(axis=0) - corners[:4].mean(axis=0)
    seen = axes.T @ np.column_stack([r, s, t])
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(seen, seen.T, atol=1e-14)
    assert np.linalg.eigvalsh(seen)[0] > 0.0


def test_isotropic_solids_have_no_axes(deck_of: DeckOf) -> None:
    _, one = batch(deck_of, STEEL + "PSOLID,9,1,5\n" + CHEXA + "\n")
    np.testing.assert_array_equal(one.facts["material_frame"], np.eye(3)[None])


@pytest.mark.parametrize(
    ("section", "code"),
    [
        ("PSOLID,9,1,7\n", "deck.unknown-coordinate-system"),
        ("PSOLID,9,1,-2\n", "deck.solid-section"),
        ("PSOLID,9,1,,,,,PFLUID\n", "deck.solid-section"),
        ("PSOLID,9,2\n", "deck.unknown-material"),
        ("PSOLID,8,1\n", "deck.unknown-property"),
        ("PSHELL,9,1,.1\n", "deck.property-type"),
        ("PSOLID,9\n", "deck.blank-field"),
    ],
)
def test_sections_that_are_refused(deck_of: DeckOf, section: str, code: str) -> None:
    assert code_of(deck_of, STEEL + section + CHEXA + "\n").code == code


def test_integration_has_no_effect_and_says_so(deck_of: DeckOf) -> None:
    model = built(deck_of, STEEL + "PSOLID,9,1,,TWO,GRID,REDUCED,SMECH\nPSOLID,10,1,,BUBBLE\n" + CHEXA + "\n")
    (notice,) = [n for n in model.notices if n.code == "deck.solid-integration"]
    assert "2 PSOLID cards" in notice.what
    assert not [n for n in built(deck_of, STEEL + LUMP + CHEXA + "\n").notices if n.code == "deck.solid-integration"]
