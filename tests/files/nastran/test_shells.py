"""CQUAD4, CTRIA3 and PSHELL with MAT1, MAT2 and MAT8, as batches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.assemble import assemble
from femtune.fem.elements.shells.normals import shared_normals
from femtune.fem.fields import FieldRef
from femtune.fem.structure import ElementBatch
from femtune.files.nastran import Deck
from femtune.files.nastran.build import BuiltDeck, build_structure
from femtune.parameters import jet

from .solving import frequencies

DeckOf = Callable[..., Deck]
CYLINDER = "CORD2C,5,,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\n"
POINTS = CYLINDER + "GRID,1,,1.,1.,0.\nGRID,2,,3.,1.,0.\nGRID,3,,3.,3.,0.\nGRID,4,,1.,3.,0.\nGRID,7,,1.,1.,5.\n"
STEEL = "MAT1,1,2.,,.25,3.,,,.01\n"
PLATE = "PSHELL,9,1,.1,1,,1\n"
QUAD = "CQUAD4,20,9,1,2,3,4"


def built(deck_of: DeckOf, text: str) -> BuiltDeck:
    return build_structure(deck_of(POINTS + text))


def batch(deck_of: DeckOf, text: str) -> tuple[BuiltDeck, ElementBatch]:
    model = built(deck_of, text)
    (one,) = model.structure.batches
    return model, one


def values(model: BuiltDeck, one: ElementBatch, i: int = 0) -> dict[str, float]:
    return {role: float(model.structure.values.values[at[i]]) for role, at in one.roles.items()}


def law(found: dict[str, float], letter: str) -> list[list[float]]:
    a, b, c, d, e, f = (found[letter + name] for name in ("11", "12", "13", "22", "23", "33"))
    return [[a, b, c], [b, d, e], [c, e, f]]


def test_a_plate_of_one_material(deck_of: DeckOf) -> None:
    text = STEEL + "PSHELL,9,1,.1,1,1.2,1,.8,.7\n" + QUAD + "\nCQUAD4,21,9,2,3,4,1\nCTRIA3,22,9,1,2,7\n"
    model = built(deck_of, text)
    quads, tri = model.structure.batches
    assert [(b.kind, b.card, b.ids.tolist()) for b in (quads, tri)] == [
        ("shell-quad", "CQUAD4", [20, 21]), ("shell-tri", "CTRIA3", [22]),
    ]  # fmt: skip
    assert quads.nodes.tolist() == [[0, 1, 2, 3], [1, 2, 3, 0]]
    assert quads.dofs[1].tolist() == [*range(6, 24), *range(6)]
    assert tri.dofs[0].tolist() == [*range(12), *range(24, 30)]
    for one in (quads, tri):
        found = values(model, one)
        # E / (1 − ν²) and the rest, written out
        stiff = 2.0 / 0.9375
        expected = [[stiff, 0.25 * stiff, 0.0], [0.25 * stiff, stiff, 0.0], [0.0, 0.0, 0.8]]
        np.testing.assert_allclose(law(found, "M"), expected, rtol=1e-15)
        np.testing.assert_allclose(law(found, "B"), expected, rtol=1e-15)
        assert [found[n] for n in ("S11", "S12", "S22")] == [0.8, 0.0, 0.8]
        assert [found[n] for n in ("t", "RI", "TS", "NSM", "rho", "z0")] == [0.1, 1.2, 0.8, 0.7, 3.0, 0.0]
        assert [found[n] for n in ("GE", "GEB", "GES")] == [0.01] * 3
        assert [one.facts[n][0] for n in ("has_membrane", "has_bending")] == [True] * 2
        assert not one.facts["offset_given"][0]


def test_defaults_are_those_of_nastran(deck_of: DeckOf) -> None:
    found = values(*batch(deck_of, STEEL + PLATE + QUAD + "\n"))
    assert [found[n] for n in ("RI", "TS", "NSM")] == [1.0, 5.0 / 6.0, 0.0]


def test_three_materials(deck_of: DeckOf) -> None:
    text = STEEL + "MAT1,2,4.,,0.,5.,,,.02\nMAT1,3,8.,,0.,6.,,,.03\nPSHELL,9,2,.1,1,,3\n"
    found = values(*batch(deck_of, text + QUAD + "\n"))
    assert (found["M11"], found["B33"], found["S11"], found["rho"]) == (4.0, 0.8, 4.0, 5.0)
    assert [found[n] for n in ("GE", "GEB", "GES")] == [0.02, 0.01, 0.03]


def test_membrane_alone_and_bending_alone(deck_of: DeckOf) -> None:
    model, one = batch(deck_of, STEEL + "PSHELL,9,1,.1\n" + QUAD + "\n")
    found = values(model, one)
    assert not np.any([*law(found, "B"), 3 * [found["S11"]]])
    assert found["M11"] > 2.0
    assert (one.facts["has_membrane"][0], one.facts["has_bending"][0]) == (True, False)
    model, one = batch(deck_of, STEEL + "PSHELL,9,,.1,1\n" + QUAD + "\n")
    found = values(model, one)
    assert not np.any(law(found, "M"))
    assert found["B11"] > 2.0
    assert found["rho"] == 3.0
    assert (one.facts["has_membrane"][0], one.facts["has_bending"][0]) == (False, True)


def test_without_mid3_the_plate_is_nearly_rigid_in_transverse_shear(deck_of: DeckOf) -> None:
    model, one = batch(deck_of, STEEL + "PSHELL,9,1,.1,1,,,.5\n" + QUAD + "\n")
    found = values(model, one)
    assert found["S11"] == found["S22"] == pytest.approx(1000 * 0.8)
    # the share of the section that resists shear has no meaning here
    assert found["TS"] == 1.0
    assert model.structure.values.index(FieldRef("PSHELL", 9, "TS")) is None


def plate(n: int, thickness: float, shear: str) -> str:
    """A simply supported unit square of n × n quads."""
    lines = ["MAT1,1,2.+11,,.3,7800.", f"PSHELL,1,1,{thickness},1,,{shear}"]
    rows = n + 1
    for k in range(rows * rows):
        edge = not 0 < k // rows < n or not 0 < k % rows < n
        lines.append(f"GRID,{k + 1},,{k // rows / n:.6f},{k % rows / n:.6f},0.,,{'1236' if edge else '126'}")
    corners = [i * rows + j + 1 for i in range(n) for j in range(n)]
    lines += [f"CQUAD4,{a},1,{a},{a + rows},{a + rows + 1},{a + 1}" for a in corners]
    return "\n".join(lines) + "\n"


@pytest.mark.slow
def test_a_thick_plate_without_mid3_has_the_frequency_of_thin_plate_theory(deck_of: DeckOf) -> None:
    t, n = 0.1, 12
    rigidity = 2e11 * t**3 / 12 / (1 - 0.3**2)
    thin = np.pi * np.sqrt(rigidity / 7800 / t)
    rigid, flexible = (frequencies(build_structure(deck_of(plate(n, t, mid3))).structure)[0] for mid3 in ("", "1"))
    # lumped mass and residual bending flexibility make this mesh 0.8 % low
    assert rigid == pytest.approx(thin, rel=0.01)
    assert flexible < 0.96 * thin


def test_orthotropic_law_is_the_inverse_of_its_compliance(deck_of: DeckOf) -> None:
    e1, e2, nu, g, g1, g2 = 140.0, 10.0, 0.3, 5.0, 4.0, 3.0
    text = f"MAT8,1,{e1},{e2},{nu},{g},{g1},{g2},3.\n" + ",\n,.07\n" + PLATE
    model, one = batch(deck_of, text + QUAD + "\n")
    found = values(model, one)
    compliance = [[1 / e1, -nu / e1, 0.0], [-nu / e1, 1 / e2, 0.0], [0.0, 0.0, 1 / g]]
    np.testing.assert_allclose(law(found, "M"), np.linalg.inv(compliance), rtol=1e-14)
    assert [found[n] for n in ("S11", "S12", "S22", "rho", "GE")] == [g1, 0.0, g2, 3.0, 0.07]


def test_orthotropic_material_that_is_rigid_in_one_transverse_shear(deck_of: DeckOf) -> None:
    found = values(*batch(deck_of, "MAT8,1,140.,10.,.3,5.,,3.\n" + PLATE + QUAD + "\n"))
    assert (found["S11"], found["S22"]) == (5000.0, 3.0)


def test_anisotropic_law_stands_on_the_card(deck_of: DeckOf) -> None:
    text = "MAT2,1,9.,2.,1.,8.,.5,4.,3.\n,,,,,.07\n" + "MAT2,2,5.,1.,,6.\n" + "PSHELL,9,1,.1,1,,2\n"
    found = values(*batch(deck_of, text + QUAD + "\n"))
    for letter in "MB":
        assert law(found, letter) == [[9.0, 2.0, 1.0], [2.0, 8.0, 0.5], [1.0, 0.5, 4.0]]
    assert [found[n] for n in ("S11", "S12", "S22", "rho", "GE")] == [5.0, 1.0, 6.0, 3.0, 0.07]


@pytest.mark.parametrize(
    ("material", "transverse"),
    [("MAT1,1,2.,,.25\n", 0.8), ("MAT1,1,2.,.8\n", 0.8), ("MAT1,1,,.8,.25\n", 0.8), ("MAT1,1,2.,.5,.25\n", 0.5)],
)
def test_a_third_modulus_counts_for_transverse_shear_alone(deck_of: DeckOf, material: str, transverse: float) -> None:
    """In the plane E and NU count, as in the element matrices that commercial Nastran wrote of solid_shell_bar."""
    model, one = batch(deck_of, material + PLATE + QUAD + "\n")
    found = values(model, one)
    assert one.roles["M11"][0] == one.roles["M22"][0]
    assert found["M11"] == pytest.approx(2.0 / 0.9375)
    assert found["M33"] == found["B33"] == pytest.approx(0.8)
    assert found["S11"] == found["S22"] == transverse


@pytest.mark.parametrize(
    ("material", "name"),
    [
        ("MAT1,1,2.,,.25\n", "NU"),
        ("MAT1,1,2.,.8\n", "G"),
        ("MAT8,1,140.,10.,.3,5.\n", "E2"),
        ("MAT8,1,140.,10.,.3,5.\n", "NU12"),
    ],
)
def test_derived_entries_follow_a_change_of_the_card(deck_of: DeckOf, material: str, name: str) -> None:
    model, one = batch(deck_of, material + PLATE + QUAD + "\n")
    card = material[:4]
    index = model.structure.values.index(FieldRef(card, 1, name))
    assert index is not None
    fields = material.strip().split(",")
    at = {"G": 3, "NU": 4, "E2": 3, "NU12": 4}[name]
    new = float(fields[at]) * 1.1
    moved = model.structure.values.evaluate({index: jet.constant(new, 0)}, 0).value
    fields[at] = f"{new:#.8g}"
    again, other = batch(deck_of, ",".join(fields) + "\n" + PLATE + QUAD + "\n")
    for role in one.roles:
        now = again.structure.values.values[other.roles[role][0]]
        np.testing.assert_allclose(moved[one.roles[role][0]], now, rtol=1e-7, err_msg=role)


def test_material_axes(deck_of: DeckOf) -> None:
    text = STEEL + PLATE + QUAD + ",30.\nCQUAD4,21,9,1,2,3,4,5\nCQUAD4,22,9,1,2,3,4,0\nCTRIA3,23,9,1,2,3,-90.\n"
    quads, tri = built(deck_of, text).structure.batches
    np.testing.assert_allclose(quads.facts["theta"], [np.pi / 6, 0.0, 0.0])
    # the centre of the element, (2, 2, 0), lies at 45 degrees of the cylinder system
    np.testing.assert_allclose(quads.facts["direction"], [[0, 0, 0], [0.5**0.5, 0.5**0.5, 0], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(tri.facts["theta"], [-np.pi / 2])


def test_offsets(deck_of: DeckOf) -> None:
    text = STEEL + PLATE + QUAD + ",,.02\nCQUAD4,21,9,1,2,3,4\nCTRIA3,22,9,1,2,3,,-.03\nCTRIA3,23,9,1,2,3,,0.\n"
    model = built(deck_of, text)
    quads, tri = model.structure.batches
    assert [values(model, quads, i)["z0"] for i in (0, 1)] == [0.02, 0.0]
    assert [values(model, tri, i)["z0"] for i in (0, 1)] == [-0.03, 0.0]
    assert quads.facts["offset_given"].tolist() == [True, False]
    assert tri.facts["offset_given"].tolist() == [True, True]


@pytest.mark.parametrize(
    ("corners", "thickness", "uneven"),
    [
        (",,,.1,.11,.12,.13", 0.115, True),
        (",,,.1,.11,,.12", 0.1075, False),
        (",,1,1.1,1.2,.9,1.", 0.105, True),
        (",,1,1.1,1.1", 0.105, False),
        (",,1", 0.1, False),
        ("", 0.1, False),
    ],
)
def test_thickness_at_the_corners(deck_of: DeckOf, corners: str, thickness: float, uneven: bool) -> None:
    model, one = batch(deck_of, STEEL + PLATE + QUAD + f"\n{corners}\n")
    assert values(model, one)["t"] == pytest.approx(thickness)
    assert ("deck.uneven-thickness" in {n.code for n in model.notices}) == uneven


def test_thickness_only_at_the_corners(deck_of: DeckOf) -> None:
    model, one = batch(deck_of, STEEL + "PSHELL,9,1,,1,,1\nCTRIA3,20,9,1,2,3\n,,,.1,.2,.3\n")
    assert values(model, one)["t"] == pytest.approx(0.2)
    (notice,) = [n for n in model.notices if n.code == "deck.uneven-thickness"]
    assert "T1 to T3 of 1 CTRIA3 " in notice.what


def test_derivative_of_a_mean_thickness(deck_of: DeckOf) -> None:
    model, one = batch(deck_of, STEEL + PLATE + QUAD + "\n,,1,1.1,1.2\n")
    table = model.structure.values
    at = [table.index(FieldRef(*ref)) for ref in (("CQUAD4", 20, "T2"), ("PSHELL", 9, "T"))]
    variables = jet.variables(np.array([1.2, 0.1]))
    t = table.evaluate({i: variables[k] for k, i in enumerate(at) if i is not None}, 2)[one.roles["t"][0]]
    np.testing.assert_allclose(t.grad, [0.1 / 4, (1.1 + 1.2 + 2.0) / 4])


@pytest.mark.parametrize(("card", "a", "b"), [("CQUAD4", 0.1, 0.3), ("CQUAD4", 0.04, 0.0), ("CTRIA3", 0.1, 0.3)])
def test_thickness_that_varies_bends_by_the_mean_of_its_cube(deck_of: DeckOf, card: str, a: float, b: float) -> None:
    """Curvature κ everywhere: E'κ²/12 ∫ t³ dA with t linear along x, from a to b over a length of 2; the area is 4."""
    elements = {
        "CQUAD4": f"CQUAD4,20,9,1,2,3,4\n,,,{a},{b},{b},{a}\n",
        "CTRIA3": f"CTRIA3,20,9,1,2,3\n,,,{a},{b},{b}\nCTRIA3,21,9,1,3,4\n,,,{a},{b},{a}\n",
    }
    structure = built(deck_of, STEEL + PLATE + elements[card]).structure
    xyz = structure.nodes.xyz
    u = np.zeros((len(xyz), 6))
    u[:, 2], u[:, 4] = 0.5 * xyz[:, 0] ** 2, -xyz[:, 0]
    found = u.ravel() @ (assemble(structure, "stiffness") @ u.ravel())
    cube = 4.0 * (a + b) * (a**2 + b**2) / 4.0
    assert found == pytest.approx(2.0 / 0.9375 / 12.0 * cube, rel=1e-10)


def test_derivative_of_the_bending_of_a_thickness_that_varies(deck_of: DeckOf) -> None:
    """Of the inertia relative to that of the mean, beside central differences; T1 and T of the property."""
    model, one = batch(deck_of, STEEL + PLATE + QUAD + "\n,,1,1.5,,1.2,.4\n")
    table = model.structure.values
    at = [table.index(FieldRef(*ref)) for ref in (("CQUAD4", 20, "T1"), ("PSHELL", 9, "T"))]
    row = one.roles["RI"][0]

    def inertia(t1: float, t: float) -> jet.Jet:
        variables = jet.variables(np.array([t1, t]))
        return table.evaluate({i: variables[k] for k, i in enumerate(at) if i is not None}, 2)[row]

    slope = (inertia(1.5 + 1e-5, 0.1).value - inertia(1.5 - 1e-5, 0.1).value) / 2e-5
    np.testing.assert_allclose(inertia(1.5, 0.1).grad, [slope, 0.0], rtol=1e-7, atol=1e-12)


def test_drilling_factor(deck_of: DeckOf) -> None:
    assert built(deck_of, "").structure.drilling == 100.0
    assert built(deck_of, "PARAM,K6ROT,1.+4\n").structure.drilling == 1e4


def test_the_angle_up_to_which_shells_share_normals(deck_of: DeckOf) -> None:
    """Two squares at 50 degrees: each normal is 25 degrees from the mean."""
    c, s = np.cos(np.radians(50.0)), np.sin(np.radians(50.0))
    text = (
        "MAT1,1,2.,,.25\nPSHELL,9,1,.1,1,,1\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\n"
        f"GRID,5,,{1 + c:.8f},0.,{s:.8f}\nGRID,6,,{1 + c:.8f},1.,{s:.8f}\nCQUAD4,1,9,1,2,3,4\nCQUAD4,2,9,2,5,6,3\n"
    )
    for card, shared in (("", False), ("PARAM,SNORM,24.9\n", False), ("PARAM,SNORM,25.1\n", True)):
        model = build_structure(deck_of(card + text))
        normals = shared_normals(model.structure.batches[0], model.structure)
        assert np.allclose(normals[0, 1], normals[1, 0]) == shared
        np.testing.assert_allclose(normals[0, 0], [0.0, 0.0, 1.0], atol=1e-15)
        assert not [n for n in model.notices if n.code == "deck.ignored-param"]
    apart = build_structure(deck_of("PARAM,SNORM,0.\n" + text)).structure
    normals = shared_normals(apart.batches[0], apart)
    np.testing.assert_allclose(normals, [[[0.0, 0.0, 1.0]] * 4, [[-s, 0.0, c]] * 4], atol=1e-7)


def test_an_angle_of_normals_that_is_too_large(deck_of: DeckOf) -> None:
    model = built(deck_of, "PARAM,SNORM,60.\n" + PLATE + STEEL + QUAD + "\n")
    (notice,) = [n for n in model.notices if n.code == "deck.ignored-param"]
    assert "SNORM = 60." in notice.what
    assert model.structure.normals_within == 45.0


_SHELL = "PSHELL,9,{}\n" + QUAD + "\n"


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        (_SHELL.format("1,.1,-1"), "deck.shell-section", "plane strain (MID2 = -1)"),
        (_SHELL.format(",.1"), "deck.shell-section", "has no material"),
        (_SHELL.format("1,.1,,,1"), "deck.shell-section", "MID3"),
        (_SHELL.format("1,.1,,,,,\n,,,1"), "deck.shell-section", "MID1 or MID2 is blank"),
        (_SHELL.format("1,.1,1,,1,,\n,,,1"), "deck.shell-section", "can be negative"),
        ("PCOMP,9\n" + QUAD + "\n", "deck.laminate", "PCOMP has no plies"),
        ("PCOMP,9\n,1,-.1\n" + QUAD + "\n", "deck.laminate", "thickness of a ply must be positive"),
        ("PCOMP,9\n,1\n" + QUAD + "\n", "deck.blank-field", "a real number"),
        ("PCOMP,9\n,1,.1,0.,MAYBE\n" + QUAD + "\n", "deck.field-value", "SOUT of a ply"),
        ("PCOMP,9\n,88,.1\n" + QUAD + "\n", "deck.unknown-material", "material 88"),
        ("PCOMP,9,,,,,,,SYMEM\n,1,.1\n" + QUAD + "\n", "deck.laminate", "LAM = SYMEM"),
        ("PCOMP,9,0.,,,,,,SMEAR\n,1,.1\n" + QUAD + "\n", "deck.laminate", "Z0 is given together with LAM = SMEAR"),
        ("PCOMP,9,,,,,,,SMCORE\n,1,.1\n" + QUAD + "\n", "deck.laminate", "LAM = SMCORE needs the plies"),
        ("PCOMPG,9\n,4,1,.1\n,4,1,.1\n" + QUAD + "\n", "deck.laminate", "global ply number 4 twice"),
        ("PCOMP,9\n,1,.1\n" + QUAD + ",,,\n,,,.1,.1,.1,.1\n", "deck.shell-section", "whose property is a laminate"),
        (_SHELL.format("1,-.1"), "deck.shell-section", "thickness T"),
        (_SHELL.format("1,.1,1,-1."), "deck.shell-section", "12I/T**3"),
        (_SHELL.format("1,.1,1,,1,0."), "deck.shell-section", "TS/T"),
        (_SHELL.format("1"), "deck.shell-section", "T of PSHELL 9 and T1 to T4 of the element are blank"),
        (_SHELL.format("1,.1") + ",,,0.,0.,0.,0.\n", "deck.shell-section", "T1 to T4"),
        (_SHELL.format("1,.1") + ",,2,1.,1.,1.,1.\n", "deck.field-value", "TFLAG"),
        (_SHELL.format("77,.1"), "deck.unknown-material", "material 77"),
        (PLATE + "CQUAD4,20,9,1,2,3,3\n", "deck.shell-corners", "with a CTRIA3"),
        (PLATE + "CQUAD4,20,9,1,1,3,3\n", "deck.shell-corners", "remove the element"),
        (PLATE + "CQUAD4,20,9,1,2,3\n", "deck.shell-corners", "G4 is blank"),
        (PLATE + "CTRIA3,20,9,1,2,1\n", "deck.shell-corners", "grid point 1"),
        (PLATE + "CTRIA3,20,9,1,2,99\n", "deck.unknown-grid", "grid point 99"),
        (PLATE + "CTRIA3,20,8,1,2,3\n", "deck.unknown-property", "known: 9"),
        ("PROD,9,1,.1\n" + QUAD + "\n", "deck.property-type", "is a PROD, but CQUAD4 needs a PSHELL, PCOMP or PCOMPG"),
        (PLATE + "CQUAD4,20,9,1,2,3,4,6\n", "deck.unknown-coordinate-system", "coordinate system 6"),
        (
            "CORD2R,6,,0.,0.,0.,1.,0.,0.\n,0.,0.,1.\nMAT2,2,2.,,,2.,,1.\n" + "PSHELL,9,2,.1\n" + QUAD + ",6\n",
            "deck.orientation",
            "normal",
        ),
        ("MAT8,1,2.,2.,.3,1.\n" + PLATE, "deck.duplicate-id", "material 1 is defined twice"),
        ("MAT8,2,2.,2.,.3,1.\nPROD,3,2,1.\nCROD,1,3,1,2\n", "deck.material-type", "PROD needs a MAT1"),
        ("MAT8,2,2.,2.,.3\n" + _SHELL.format("2,.1"), "deck.material", "G12"),
        ("MAT8,2,2.,9.,.5,1.\n" + _SHELL.format("2,.1"), "deck.material", "NU12"),
        ("MAT8,2,2.,9.,.1,1.,-1.\n" + _SHELL.format("2,.1,2,,2"), "deck.material", "G1Z"),
        ("MAT2,2,2.,9.,,2.,,1.\n" + _SHELL.format("2,.1"), "deck.material", "positive definite"),
        ("MAT2,2,2.,,,2.\n" + _SHELL.format("2,.1"), "deck.material", "positive definite"),
        ("MAT1,2,2.\n" + _SHELL.format("2,.1"), "deck.material", "give NU or G"),
        ("MAT1,2,9.,1.\n" + _SHELL.format("2,.1"), "deck.material", "Poisson's ratio of 3.5"),
        ("PARAM,K6ROT,-1.\n", "deck.param", "zero or more"),
    ],
)
def test_errors(deck_of: DeckOf, text: str, code: str, message: str) -> None:
    with pytest.raises(FemtuneError) as error:
        built(deck_of, STEEL + text)
    assert error.value.code == code
    assert message in str(error.value)
    assert error.value.where is not None
    assert error.value.where.line


def test_coupling_by_mid4_counts_below_the_middle(deck_of: DeckOf) -> None:
    """A plate and a coupling as of an offset: G4 = −G z0/t makes the matrices of ZOFFS, but for z0² in bending."""
    z0, t = 0.03, 0.1
    inertia = 1.0 + 12.0 * (z0 / t) ** 2
    stiff = 2.0 / 0.9375
    law = [-entry * z0 / t for entry in (stiff, 0.25 * stiff, 0.0, stiff, 0.0, 0.8)]
    fields = ",".join("" if entry == 0.0 else f"{entry:.14g}" for entry in law)
    text = f"MAT2,4,{fields}\nPSHELL,9,1,{t},1,{inertia!r},1\n,,,4\n"
    square = "GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,1.,1.,0.\nGRID,4,,0.,1.,0.\n"
    one, other = (
        build_structure(deck_of(square + STEEL.replace("3.", "") + more)).structure
        for more in (text + "CQUAD4,20,9,1,2,3,4\n", f"PSHELL,9,1,{t},1,,1\nCQUAD4,20,9,1,2,3,4,,{z0}\n")
    )
    a, b = (assemble(structure, "stiffness").toarray() for structure in (one, other))
    x, y = one.nodes.xyz[:, 0], one.nodes.xyz[:, 1]
    # stretching by e and bending by κ, both constant
    u = np.zeros((4, 6))
    u[:, 0], u[:, 2], u[:, 4] = 0.7 * x, -0.5 * 0.4 * x**2, 0.4 * x
    v = np.zeros((4, 6))
    v[:, 0], v[:, 1], v[:, 4], v[:, 3] = 0.3 * y, 0.3 * x, 0.2 * y, -0.2 * x
    v[:, 2] = -0.2 * x * y
    for field in (u.ravel(), v.ravel()):
        assert field @ a @ field == pytest.approx(field @ b @ field, rel=1e-12)


def test_a_laminate_says_that_ply_damping_has_no_effect(deck_of: DeckOf) -> None:
    for text, told in (("PCOMP,9\n,1,.1\n", True), ("PCOMP,9,,,,,,0.\n,1,.1\n", False)):
        model, one = batch(deck_of, STEEL + text + QUAD + "\n")
        assert ("deck.ply-damping" in {notice.code for notice in model.notices}) is told
        assert values(model, one)["GE"] == 0.0


def test_plies_follow_the_one_before(deck_of: DeckOf) -> None:
    lamina = "MAT8,2,2.,2.,.3,1.\n"
    text = lamina + "PCOMP,9,,,,,,.01\n,1,.1,,,2,,45.,YES\n,,,,,2,.3,,NO\n,,,30.\n"
    model, _ = batch(deck_of, STEEL + text + QUAD + "\n")
    table = model.structure.values
    names = {ref.name: table.values[table.index(ref)] for ref in model.fields if ref.card == "PCOMP"}
    # the blank group is no ply; the third ply stands behind it
    assert {k: v for k, v in names.items() if k[0] == "T" and k[1] != "H"} == {"T1": 0.1, "T3": 0.3}
    assert {k: v for k, v in names.items() if k[:2] == "TH"} == {"THETA1": 0, "THETA2": 45, "THETA3": 0, "THETA4": 30}
    height = next(value for ref, value in zip(table.refs, table.values) if ref.name == "mass")
    assert height == pytest.approx(0.1 * 3.0)
