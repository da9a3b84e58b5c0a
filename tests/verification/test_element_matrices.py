"""Element matrices that commercial Nastran wrote beside ours, and a deck of single elements that they explain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from femtune.fem.assemble import assemble
from femtune.files.nastran import build_structure, read_deck
from structures.shells import Isotropic, Section, ShellPart, shell_structure

from .element_matrices import changed_decks, commercial, op2, ours

PLATE = {"young": 2.9e7, "poisson": 0.32, "shear": 1.1e7}


@pytest.fixture(scope="module")
def source(shared_data: Path) -> Path:
    return shared_data / "nastran_decks"


@pytest.fixture(scope="module")
def theirs(source: Path) -> dict[str, Any]:
    file = source / "solid_shell_bar" / "static_solid_shell_bar_kelm.op2"
    return {kind: op2.element_matrices(file, kind) for kind in "KM"} | {"blocks": op2.data_blocks(file)}


@pytest.fixture(scope="module")
def structure(source: Path) -> Any:
    return build_structure(read_deck(source / "solid_shell_bar" / changed_decks.SOLID_DECK)).structure


def test_the_matrices_that_were_read_make_the_assembled_one(theirs: dict[str, Any]) -> None:
    """KGG of the same file is the sum of all elements."""
    assembled = op2.matrix_columns(theirs["blocks"]["KGG"])
    total = np.zeros_like(assembled)
    for matrix in theirs["K"].values():
        dofs = ours.dofs_of(matrix)
        total[np.ix_(dofs, dofs)] += matrix.matrix
    assert len(theirs["K"]) == 21
    np.testing.assert_allclose(total, assembled, atol=1e-15 * np.abs(assembled).max())


def test_bars_beams_and_rods_are_the_same_to_rounding(structure: Any, theirs: dict[str, Any]) -> None:
    found = ours.our_matrices(structure, "stiffness")
    lines = [n for n, matrix in found.items() if matrix.card in ("CBAR", "CBEAM", "CROD")]
    assert sorted(lines) == [12, 13, 14, 15]
    assert max(ours.difference(theirs["K"][n], found[n]) for n in lines) < 1e-14


def test_masses_are_the_same_to_rounding(structure: Any, theirs: dict[str, Any]) -> None:
    """But for ρ I L/2 of rotary inertia at the ends of a CBEAM, which not all versions have."""
    found = ours.our_matrices(structure, "mass")
    assert max(ours.difference(theirs["M"][n], m) for n, m in found.items() if m.card != "CBEAM") < 1e-14
    beam = found[12]
    extra = np.diag(theirs["M"][12].matrix - beam.on(ours.dofs_of(theirs["M"][12]))).reshape(2, 6)
    np.testing.assert_allclose(extra[:, :3], 0.0, atol=1e-16)
    np.testing.assert_allclose(extra[:, 5], 0.0, atol=1e-12)
    np.testing.assert_allclose(extra[:, 3:5], 0.283 * 0.0052083 / 2.0, rtol=1e-4)


@pytest.mark.quick(3)
@pytest.mark.parametrize("number", [6, 7, 8, 9, 10, 11, 16, 17, 18, 19, 20, 21])
def test_shells_share_membrane_and_constant_curvature(structure: Any, theirs: dict[str, Any], number: int) -> None:
    """Any motion of constant strain or curvature, with no drilling and no transverse shear, meets the same forces."""
    matrix = theirs["K"][number]
    xyz = structure.nodes.xyz[[row // 6 for row in matrix.rows]]
    corners, axes = ours.shell_axes(xyz)
    difference = matrix.matrix - ours.our_matrices(structure, "stiffness")[number].on(ours.dofs_of(matrix))
    in_plane, bending = (ours.part(difference, axes, c) for c in (ours.MEMBRANE, ours.BENDING))
    size = np.abs(ours.part(matrix.matrix, axes, ours.BENDING)).max()
    x, y = (corners - corners.mean(axis=0)).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    # w = −½x², −½y², −xy: slopes are θx = w,y and θy = −w,x
    for w, tx, ty in ((-0.5 * x**2, zero, x), (-0.5 * y**2, -y, zero), (-x * y, -x, y)):
        np.testing.assert_allclose(bending @ np.column_stack([w, tx, ty]).ravel(), 0.0, atol=1e-6 * size)
    for u, v in ((x, zero), (zero, y), (y, x)):
        np.testing.assert_allclose(in_plane @ np.column_stack([u, v, zero]).ravel(), 0.0, atol=1e-12 * size)
    np.testing.assert_allclose(in_plane @ np.column_stack([-y, x, one]).ravel(), 0.0, atol=1e-12 * size)


THICKNESS = {**dict.fromkeys(range(6, 12), 0.25), 16: 1.0, 17: 1.5, 18: 1.0, 19: 1.0, 20: 1.5, 21: 1.5}


@pytest.mark.quick(7)
@pytest.mark.parametrize("number", THICKNESS)
def test_membrane_and_drilling_are_the_same_to_rounding(structure: Any, theirs: dict[str, Any], number: int) -> None:
    """Of all twelve shells; drilling is the forces' moments, which are small beside the membrane's forces."""
    matrix = theirs["K"][number]
    axes = ours.shell_axes(structure.nodes.xyz[[row // 6 for row in matrix.rows]])[1]
    own = ours.our_matrices(structure, "stiffness")[number].on(ours.dofs_of(matrix))
    found, wanted = (ours.part(m, axes, ours.MEMBRANE) for m in (own, matrix.matrix))
    for rows in (slice(None), slice(2, None, 3)):
        np.testing.assert_allclose(found[rows], wanted[rows], atol=1e-14 * np.abs(wanted[rows]).max())


@pytest.mark.parametrize("number", THICKNESS)
def test_the_formulas_of_the_commercial_shells(structure: Any, theirs: dict[str, Any], number: int) -> None:
    """Bending, transverse shear and drilling as the example says, at three thicknesses."""
    matrix = theirs["K"][number]
    corners, axes = ours.shell_axes(structure.nodes.xyz[[row // 6 for row in matrix.rows]])
    plate = commercial.Plate(**PLATE, thickness=THICKNESS[number])
    bending, in_plane = (ours.part(matrix.matrix, axes, c) for c in (ours.BENDING, ours.MEMBRANE))
    np.testing.assert_allclose(
        commercial.bending_stiffness(plate, corners), bending, atol=1e-12 * np.abs(bending).max()
    )
    turning = commercial.drilling_stiffness(100.0, plate, corners)[2::3]
    np.testing.assert_allclose(turning, in_plane[2::3], atol=1e-12 * np.abs(turning).max())


LISTED = [46.014, 47.388, 147.61, 309.85, 441.41, 1334.9, 1793.5]


def test_commercial_shells_in_our_model_give_the_listed_modes(source: Path) -> None:
    """One square, one triangle and four bars: nothing else differs, so these elements are the reason.

    Modes 1 and 4 are in-plane: the bars hold to the sheet by its drilling stiffness alone.
    """
    structure = build_structure(read_deck(source / changed_decks.SHEET_DECK)).structure
    plate = commercial.Plate(2e6, 0.33, 2e6 / 2.66, 0.1)
    stiffness = assemble(structure, "stiffness").toarray()
    own = ours.frequencies(structure, stiffness, 3, 7)
    for card in ("CQUAD4", "CTRIA3"):
        stiffness += ours.on_shells(
            structure, card, ours.BENDING, lambda corners, own: commercial.bending_stiffness(plate, corners) - own
        )
    found = ours.frequencies(structure, stiffness, 3, 7)
    np.testing.assert_allclose(found, LISTED, rtol=2e-5)
    np.testing.assert_allclose(own[[0, 3]], np.array(LISTED)[[0, 3]], rtol=2e-5)
    np.testing.assert_allclose(own, LISTED, rtol=0.008)


@pytest.mark.quick(2)
@pytest.mark.parametrize("thickness", [1.5, 0.25, 1e-4])
@pytest.mark.parametrize("first", [0, 2])
def test_a_square_bends_as_that_of_the_commercial_program(thickness: float, first: int) -> None:
    """Its formulas, which the file above shows to be right at three thicknesses; from any corner, in any position."""
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    xyz = np.roll([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]], first, axis=0) @ turn
    section = Section(Isotropic(PLATE["young"], PLATE["poisson"]), thickness)
    structure = shell_structure(xyz, [ShellPart(np.arange(4)[None], section)], drilling=0.0)
    corners, axes = ours.shell_axes(xyz)
    found = ours.part(assemble(structure, "stiffness").toarray(), axes, ours.BENDING)
    moduli = PLATE | {"shear": PLATE["young"] / (2.0 + 2.0 * PLATE["poisson"])}
    exact = commercial.bending_stiffness(commercial.Plate(**moduli, thickness=thickness), corners)
    np.testing.assert_allclose(found, exact, atol=1e-12 * np.abs(exact).max())


@pytest.mark.slow
def test_a_plate_of_squares_has_the_listed_modes(source: Path) -> None:
    """Six digits."""
    structure = build_structure(read_deck(source / changed_decks.PLATE_DECK)).structure
    found = ours.frequencies(structure, assemble(structure, "stiffness").toarray(), 6, 4)
    np.testing.assert_allclose(found, [6333.01, 7495.47, 16238.5, 17161.5], rtol=5e-6)


@pytest.mark.slow
def test_meshes_of_the_same_structure_converge(source: Path, tmp_path: Path) -> None:
    """Single elements with lumped mass are up to 60 % away: a percent between programs says nothing of either."""
    last = None
    steps = []
    for n in (1, 2, 4):
        structure = build_structure(read_deck(changed_decks.refined(source, tmp_path, n))).structure
        found = ours.frequencies(structure, assemble(structure, "stiffness").toarray(), 3, 7)
        if last is not None:
            steps.append(np.abs(found / last - 1.0).max())
        last = found
    assert steps[0] > 0.4
    assert steps[1] < 0.12


@pytest.mark.slow
def test_commercial_shells_and_wedges_in_our_model_of_every_kind_give_the_listed_modes(
    source: Path, theirs: dict[str, Any]
) -> None:
    """PCOMP among them; ours are 0.02 to 0.19 % lower."""
    structure = build_structure(read_deck(source / "solid_shell_bar" / changed_decks.MODES_DECK)).structure
    listed = np.array([71.26832, 75.95746, 125.7872])
    stiffness = assemble(structure, "stiffness").toarray()
    own = ours.frequencies(structure, stiffness, 0, 3) / listed - 1.0
    assert np.abs(own).max() < 0.002
    for number, matrix in ours.our_matrices(structure, "stiffness").items():
        if matrix.card in ("CQUAD4", "CTRIA3", "CPENTA"):
            at = ours.dofs_of(theirs["K"][number])
            stiffness[np.ix_(at, at)] += theirs["K"][number].matrix - matrix.on(at)
    np.testing.assert_allclose(ours.frequencies(structure, stiffness, 0, 3), listed, rtol=1e-6)


def test_no_output2_file_is_a_plain_error(tmp_path: Path) -> None:
    path = tmp_path / "broken.op2"
    path.write_bytes(b"\x04\x00\x00\x00\x03\x00\x00\x00")
    with pytest.raises(ValueError, match="no record"):
        op2.data_blocks(path)
