"""Shapes of elements: every measure against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.fem.element_shapes import TESTS, element_shapes, quadrilaterals, triangles
from femtune.fem.structure import Structure
from structures.frames import bars, make_structure
from structures.shells import Isotropic, Section, ShellPart, shell_structure
from structures.solids import SolidPart, box, solid_mesh, solid_model, solid_structure

STEEL = Isotropic(200.0, 0.3, 2.0)
SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}


def _quad(*corners: tuple[float, ...]) -> dict[str, float]:
    xyz = np.zeros((1, 4, 3))
    for i, corner in enumerate(corners):
        xyz[0, i, : len(corner)] = corner
    return {key: float(v[0]) for key, v in quadrilaterals(xyz).items()}


def test_a_rectangle():
    assert _quad((0, 0), (4, 0), (4, 2), (0, 2)) == pytest.approx(
        {"Q4_SKEW": 90.0, "Q4_TAPER": 0.0, "Q4_WARP": 0.0, "Q4_IAMIN": 90.0, "Q4_IAMAX": 90.0, "Q4_AR": 2.0}
    )


def test_a_rhombus_is_skewed():
    """Sides of one at 40 degrees: so are the lines between the middles of its sides."""
    c, s = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    found = _quad((0, 0), (1, 0), (1 + c, s), (c, s))
    assert found["Q4_SKEW"] == pytest.approx(40.0)
    assert (found["Q4_IAMIN"], found["Q4_IAMAX"]) == pytest.approx((40.0, 140.0))
    assert found["Q4_TAPER"] == pytest.approx(0.0, abs=1e-12)


def test_a_trapezoid_is_tapered():
    """Parallel sides 3 and 1 at a distance of 2: area 4, triangles of 3 and 1 at its corners, half of the area 2."""
    found = _quad((0, 0), (3, 0), (2, 2), (1, 2))
    assert found["Q4_TAPER"] == pytest.approx(0.5)
    assert found["Q4_IAMIN"] == pytest.approx(np.degrees(np.arctan(2.0)))


def test_a_warped_square():
    """One corner lifted by 0.4: corners are 0.1 off the mean plane along z."""
    found = _quad((0, 0), (1, 0), (1, 1, 0.4), (0, 1))
    # the plane's normal is that of the diagonals (1, 1, 0.4) × (−1, 1, 0)
    normal = np.array([-0.4, -0.4, 2.0]) / np.linalg.norm([-0.4, -0.4, 2.0])
    height = 0.5 * abs(0.5 * 0.4 * normal[2] * 1.0)
    diagonals = 0.5 * (np.sqrt(2.16) + np.sqrt(2.0))
    assert found["Q4_WARP"] == pytest.approx(height / diagonals)


def test_a_reflex_corner_has_more_than_180_degrees():
    assert _quad((0, 0), (2, 0), (0.5, 0.5), (0, 2))["Q4_IAMAX"] == pytest.approx(
        270.0 - 2 * np.degrees(np.arctan(1 / 3)) + 0.0, abs=1e-9
    )


def test_a_triangle():
    """Sides 3, 4, 5."""
    found = triangles(np.array([[[0.0, 0, 0], [4, 0, 0], [0, 3, 0]]]))
    assert {k: float(v[0]) for k, v in found.items()} == pytest.approx(
        {"T3_SKEW": np.degrees(np.arctan(0.75)), "T3_IAMAX": 90.0, "T3_AR": 5.0 / 3.0}
    )


def _extremes(structure: Structure) -> dict[str, float]:
    return {f.test.key: f.extreme for f in element_shapes(structure)}


@pytest.mark.parametrize(
    ("kind", "key"), [("hexa8", "HEX"), ("penta6", "PEN"), ("tetra4", "TET"), ("pyram5", "PYR"),
                      ("hexa20", "HEX"), ("penta15", "PEN"), ("tetra10", "TET"), ("pyram13", "PYR")]
)  # fmt: skip
def test_solids_of_a_regular_mesh(kind: str, key: str):
    """Boxes 1 × 1 × 1: middles of sides in the middle, straight, faces plane, all turned the right way."""
    found = _extremes(solid_model(solid_mesh(box(2.0, 2.0, 2.0), (2, 2, 2), kind), STEEL))
    assert found[f"{key}_DETJ"] == pytest.approx(1.0)
    ratio = {"HEX": 1.0, "PEN": np.sqrt(2.0), "PYR": 2.0 / np.sqrt(3.0)}
    # tetrahedra along the diagonal: longest side √3, volume 1/6, largest face √2/2
    assert found[f"{key}_AR"] == pytest.approx(ratio.get(key, np.sqrt(3.0) * np.sqrt(2.0)))
    if key != "TET":
        assert found[f"{key}_WARP"] == pytest.approx(1.0)
    assert (f"{key}_EPLR" in found) == (kind[-2:] in ("20", "15", "10", "13"))
    if f"{key}_EPLR" in found:
        assert found[f"{key}_EPLR"] == pytest.approx(1.0)
        assert found[f"{key}_EPIA"] == pytest.approx(180.0)


def test_a_middle_grid_point_off_the_middle():
    """Moved along to the quarter point: the limit; moved across by half of the half: an angle of 2 atan 2."""
    mesh = solid_mesh(box(2.0, 2.0, 2.0), (1, 1, 1), "hexa20")
    middle = int(np.flatnonzero(np.all(mesh.uvw == [0.5, 0.0, 0.0], axis=1))[0])
    for move, key, value in (
        ((0.5, 0, 0), "HEX_EPLR", 0.5),
        ((0, -0.5, 0), "HEX_EPIA", 2 * np.degrees(np.arctan(2))),
    ):
        xyz = mesh.xyz.copy()
        xyz[middle] += move
        structure = solid_structure(xyz, [SolidPart("hexa20", mesh.cells, STEEL)])
        assert _extremes(structure)[key] == pytest.approx(value)


def test_a_degenerate_corner():
    """A hexahedron whose corner is moved past the plane of its neighbours is inside out there."""
    mesh = solid_mesh(box(1.0, 1.0, 1.0), (1, 1, 1))
    corner = int(np.flatnonzero(np.all(mesh.uvw == 1.0, axis=1))[0])
    xyz = mesh.xyz.copy()
    xyz[corner] = (0.6, 0.6, 0.6)
    (found,) = (f for f in element_shapes(solid_structure(xyz, [SolidPart("hexa8", mesh.cells, STEEL)]))
                if f.test.key == "HEX_DETJ")  # fmt: skip
    assert (found.beyond, found.ids, found.cards) == (1, (1,), ("CHEXA",))
    # three sides (−0.4, −0.4, 0.6)… from the corner to its neighbours span −.4³·(…): the determinant by hand
    sides = np.array([[-0.6, 0.4, 0.4], [0.4, -0.6, 0.4], [0.4, 0.4, -0.6]])
    assert found.values[0] == pytest.approx(-np.linalg.det(sides) / 1.0)


def test_offsets_of_bars_and_beams():
    part = bars([[0, 1]], SECTION, offsets=((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)))
    beam = bars([[0, 1]], SECTION, card="CBEAM", offsets=((0.0, 3.0, 0.0), (0.0, 3.0, 0.0)))
    found = _extremes(make_structure([[0, 0, 0], [2.0, 0, 0]], [part, beam]))
    assert found == pytest.approx({"BAR_OFF": 0.25, "BEAM_OFF": 0.0})


def test_limits_and_order_of_the_worst():
    """Three squares, sheared by 30, 50 and 70 degrees: limits of the caller count, elements that are off do not."""
    xyz, cells = [], []
    for k, lean in enumerate((30.0, 50.0, 70.0)):
        c, s = np.cos(np.radians(lean)), np.sin(np.radians(lean))
        cells.append([len(xyz) + i for i in range(4)])
        xyz += [(3 * k, 0, 0), (3 * k + 1, 0, 0), (3 * k + 1 + c, s, 0), (3 * k + c, s, 0)]
    structure = shell_structure(xyz, [ShellPart(np.array(cells), Section(STEEL, 0.1))])

    def skew(**how: object):
        return next(f for f in element_shapes(structure, **how) if f.test.key == "Q4_SKEW")

    assert (skew(limits={"Q4_SKEW": 29.0}).beyond, skew(limits={"Q4_SKEW": 29.0}).tested) == (0, 3)
    found = skew(limits={"Q4_SKEW": 60.0})
    assert (found.ids, found.values, found.limit) == ((1, 2), pytest.approx((30.0, 50.0)), 60.0)
    assert skew(limits={"Q4_SKEW": 60.0}, off={1}).ids == (2,)


def test_default_limits_are_the_usual_ones():
    assert {k: TESTS[k].limit for k in ("Q4_SKEW", "Q4_TAPER", "Q4_WARP", "Q4_IAMIN", "Q4_IAMAX", "T3_SKEW", "T3_IAMAX",
            "TET_AR", "TET_EPLR", "TET_DETJ", "HEX_AR", "HEX_WARP", "PEN_AR", "BEAM_OFF", "BAR_OFF")} == {
        "Q4_SKEW": 30.0, "Q4_TAPER": 0.5, "Q4_WARP": 0.05, "Q4_IAMIN": 30.0, "Q4_IAMAX": 150.0, "T3_SKEW": 10.0,
        "T3_IAMAX": 160.0, "TET_AR": 100.0, "TET_EPLR": 0.5, "TET_DETJ": 0.0, "HEX_AR": 100.0, "HEX_WARP": 0.707,
        "PEN_AR": 100.0, "BEAM_OFF": 0.15, "BAR_OFF": 0.15}  # fmt: skip
