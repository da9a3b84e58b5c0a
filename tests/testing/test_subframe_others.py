"""The shell frame and the solid bracket: sizes, masses, no mechanism; figures of quality on elements by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from femtune.files.nastran import build_structure, read_deck
from structures.bracket import solid_bracket, solid_bracket_parameters
from structures.ladder_frame import shell_frame, shell_frame_parameters
from structures.meshed import Elements, MeshedStructure, write_structure
from structures.shells import natural_frequencies
from structures.subframe import aspect_ratios, corner_ratios, extents, mesh_quality, skews_deg, warps

CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)


@pytest.mark.quick(1)
@pytest.mark.parametrize(("make", "n_dofs"), [(shell_frame, 4_000), (shell_frame, 40_000), (solid_bracket, 200_000)])
def test_sizes_and_shapes(make: Callable[[int], MeshedStructure], n_dofs: int) -> None:
    made = make(n_dofs)
    quality = mesh_quality(made)
    assert made.n_dofs == pytest.approx(n_dofs, rel=0.1)
    assert quality.unused_nodes == 0
    assert quality.nearest > 4e-4
    assert quality.aspect < 10.0
    assert quality.jacobian > 0.3


@pytest.mark.slow
@pytest.mark.parametrize(("make", "n_dofs"), [(shell_frame, 4_000), (solid_bracket, 2_200)])
def test_mass_does_not_depend_on_the_mesh(make: Callable[[int], MeshedStructure], n_dofs: int) -> None:
    assert mesh_quality(make(n_dofs)).mass == pytest.approx(mesh_quality(make(20 * n_dofs)).mass, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "parameters"),
    [(shell_frame(4_000), shell_frame_parameters()), (solid_bracket(2_200), solid_bracket_parameters())],
    ids=["shell frame", "solid bracket"],
)
def test_six_rigid_modes_and_parameters_in_the_deck(made: MeshedStructure, parameters: tuple, tmp_path: Path) -> None:
    built = build_structure(read_deck(write_structure(made, tmp_path / "deck.bdf")))
    freq_hz = natural_frequencies(built.structure, 8)
    assert np.all(freq_hz[:6] < 0.2)
    assert freq_hz[6] > 30.0
    assert set(parameters) <= set(built.fields)


def test_volume_and_corners_of_a_bent_hexahedron() -> None:
    block = CUBE * [1.0, 2.0, 3.0]
    block[4:, 0] += 0.5
    one = Elements("CHEXA", 1, np.array([1]), np.arange(8)[None])
    assert extents(block, one) == pytest.approx(6.0)
    assert corner_ratios(block, one) == pytest.approx(1.0)
    assert extents(CUBE, Elements("CHEXA", 1, np.array([1]), np.array([[4, 5, 6, 7, 0, 1, 2, 3]]))) == pytest.approx(
        -1.0
    )


def test_a_hexahedron_that_narrows_has_the_volume_of_a_frustum() -> None:
    frustum = CUBE.copy()
    frustum[4:, :2] *= 0.5
    one = Elements("CHEXA", 1, np.array([1]), np.arange(8)[None])
    assert extents(frustum, one) == pytest.approx((1.0 + 0.25 + 0.5) / 3.0)


def test_distortions_of_quadrilaterals_by_hand() -> None:
    flat = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float)
    quad = Elements("CQUAD4", 1, np.array([1]), np.arange(4)[None])
    assert aspect_ratios(flat, quad) == pytest.approx(2.0)
    assert skews_deg(flat, quad) == pytest.approx(0.0, abs=1e-6)
    lean = flat + np.array([[0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0]])
    assert skews_deg(lean, quad) == pytest.approx(45.0)
    bent = flat + np.array([[0, 0, 0.01], [0, 0, -0.01], [0, 0, 0.01], [0, 0, -0.01]])
    assert warps(bent, quad) == pytest.approx(0.01 / 1.5, rel=1e-3)
