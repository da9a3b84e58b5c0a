"""Patches of structured mesh and their welding, against counts and areas that follow from the drawing."""

from __future__ import annotations

import numpy as np
import pytest

from structures.meshed import Elements, Hole, Patch, holed_sheet, sheet, solid_ring, ticks, triangle_sheet, weld
from structures.subframe import extents


def _area(patch: Patch) -> float:
    return float(extents(patch.points, Elements("CQUAD4", 1, np.arange(len(patch.cells)), patch.cells)).sum())


def _normals(patch: Patch) -> np.ndarray:
    p = patch.points[patch.cells]
    return np.cross(p[:, 1] - p[:, 0], p[:, -1] - p[:, 0])


def test_ticks_hit_every_break_and_split_long_intervals_in_two() -> None:
    x = ticks((0.3, 0.0, 0.1), 1.0)
    np.testing.assert_allclose(x, [0.0, 0.05, 0.1, 0.2, 0.3])


def test_equal_intervals_have_equal_cells() -> None:
    x = ticks((0.0, 0.025, 0.3, 0.325), 0.0071)
    assert np.sum(x <= 0.025) == np.sum(x >= 0.3 - 1e-12)


@pytest.mark.parametrize("outward", [1, -1])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_normals_of_a_sheet_point_outwards(axis: int, outward: int) -> None:
    coordinates: list = [np.linspace(0.0, 0.3, 4)] * 3
    coordinates[axis] = 0.2
    normals = _normals(sheet("g", *coordinates, outward=outward))
    assert np.all(normals[:, axis] * outward > 0.0)


def test_a_triangle_sheet_is_half_a_square() -> None:
    u = np.linspace(0.0, 0.1, 6)
    quads, triangles = triangle_sheet("g", u, u, 0.0)
    assert (len(quads.cells), len(triangles.cells)) == (10, 5)
    assert _area(quads) + _area(triangles) == pytest.approx(0.005)


def test_a_holed_sheet_misses_its_polygon() -> None:
    hole = Hole(np.linspace(0.0, 0.08, 5), np.linspace(-0.04, 0.04, 5), 0.01)
    polygon = 16 / 2 * 0.01**2 * np.sin(2.0 * np.pi / 16)
    assert _area(holed_sheet("g", hole, 0.0)) == pytest.approx(0.08**2 - polygon, rel=1e-12)


def test_a_solid_ring_has_the_volume_of_its_prism() -> None:
    hole = Hole(np.linspace(0.0, 0.08, 5), np.linspace(-0.04, 0.04, 5), 0.01)
    patch = solid_ring("g", np.array([hole.ring(r) for r in (0.01, 0.02, 0.03)]), np.linspace(0.0, 0.1, 3))
    volume = extents(patch.points, Elements("CHEXA", 1, np.arange(len(patch.cells)), patch.cells))
    assert volume.min() > 0.0
    assert volume.sum() == pytest.approx(16 / 2 * np.sin(2.0 * np.pi / 16) * (0.03**2 - 0.01**2) * 0.1, rel=1e-12)


def test_sheets_that_meet_share_the_nodes_of_their_edge() -> None:
    u = np.linspace(0.0, 0.1, 5)
    mesh = weld([sheet("a", u, u, 0.0), sheet("b", u, 0.1, u), sheet("a", -u, u, 0.0)])
    assert len(mesh.points) == 25 + 20 + 20
    assert len(mesh.cells["a", 4]) == 32


def test_a_weld_drops_points_without_cells_and_finds_the_others() -> None:
    u = np.linspace(0.0, 0.1, 6)
    mesh = weld(triangle_sheet("g", u, u, 0.0))
    assert len(mesh.points) == 21
    assert mesh.points[mesh.rows(np.array([[0.04, 0.06, 0.0]]))[0]] == pytest.approx([0.04, 0.06, 0.0])
    with pytest.raises(ValueError, match="no mesh point"):
        mesh.rows(np.array([[0.1, 0.1, 0.0]]))
