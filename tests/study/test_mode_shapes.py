"""Shapes kept for drawing: lines of active elements, motion in basic axes, sensors where they sit."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.deck_models import model_of

import femtune as ft
from femtune.fem import NodeTable
from femtune.model import Configuration, ConfiguredModel, solve_modes
from femtune.selection import energy_map
from femtune.steps.modes import shapes as record_shapes
from femtune.steps.modes.shapes import grid_translations
from femtune.steps.run.result import RunResult
from femtune.study.drawn_mesh import (
    ELEMENT,
    RIGID,
    DrawnMesh,
    active_faces,
    active_lines,
    elements_at,
    mesh_beside,
    thinned,
    whole_mesh,
)
from structures.shells import Isotropic, Section, ShellPart, rectangle, shell_mesh, shell_structure

# a portal: two columns, a rigid floor from grid 5 to their tops, a spring of no length, a mass without lines
PORTAL = """BEGIN BULK
CORD2R  7               0.0     0.0     0.0     1.0     2.0     3.0
                2.0     0.0     -1.0
GRID    1               0.0     0.0     0.0
GRID    2               2.0     0.0     0.0
GRID    3               0.0     0.0     1.0     {cd}
GRID    4               2.0     0.0     1.0     {cd}
GRID    5               0.5     0.3     1.0     {cd}
GRID    6               0.5     0.3     1.0     {cd}
MAT1    1       2.1+11          0.3     7850.
PBAR    1       1       1.0-3   2.0-7   5.0-7   4.0-7
CBAR    1       1       1       3       1.0     0.0     0.0
CBAR    2       1       2       4       1.0     0.0     0.0
RBE2    11      5       123456  3       4
RBE2    12      5       123456  6
CONM2   21      5               40.0
CELAS2  31      100.    5       1       6       1
SPC1    1       123456  1       2
ENDDATA
"""


def _portal(folder: Path, cd: str = "", off: frozenset[int] = frozenset()) -> ConfiguredModel:
    path = folder / f"portal{cd}.bdf"
    path.write_text("SOL 103\nCEND\nSPC = 1\n" + PORTAL.replace("{cd}", cd))
    return model_of(path, Configuration(elements_off=off))


@pytest.mark.parametrize(
    ("off", "elements", "rigid"),
    [
        (frozenset(), {(1, 3), (2, 4)}, {(3, 5), (4, 5)}),
        (frozenset({2}), {(1, 3)}, {(3, 5), (4, 5)}),
    ],
)
def test_lines_are_those_of_active_elements_of_some_length(
    tmp_path: Path, off: frozenset[int], elements: set[tuple[int, int]], rigid: set[tuple[int, int]]
) -> None:
    lines, kinds = active_lines(_portal(tmp_path, off=off).model.structure, off)
    ends = [(int(a) + 1, int(b) + 1) for a, b in lines]
    assert {e for e, kind in zip(ends, kinds) if kind == ELEMENT} == elements
    assert {e for e, kind in zip(ends, kinds) if kind == RIGID} == rigid


def test_motion_is_in_basic_axes_whatever_the_displacement_frames(tmp_path: Path) -> None:
    """The same structure with its displacements in a skew system moves alike, up to the sign of a mode."""
    found = []
    for cd in ("", "7"):
        configured = _portal(tmp_path, cd)
        found.append(grid_translations(configured, solve_modes(configured.at(np.zeros(0)), 3)))
    plain, skew = found
    signs = np.sign(np.einsum("nim,nim->m", plain, skew))
    np.testing.assert_allclose(skew * signs, plain, atol=1e-9 * np.abs(plain).max())


def test_strain_energy_is_that_of_each_line_and_of_the_spring_that_is_no_line(tmp_path: Path) -> None:
    configured = _portal(tmp_path)
    solution, mesh = solve_modes(configured.at(np.zeros(0)), 3), record_shapes.drawn_mesh(configured)
    found = record_shapes.element_shares(configured, solution, mesh)
    shares = energy_map(solution)
    strain = {name: 100.0 * row for name, row in zip(shares.groups, shares.strain)}
    for element, ends in (("1", (0, 2)), ("2", (1, 3))):
        (line,) = mesh.line_of(np.array([ends[::-1]]))
        np.testing.assert_allclose(found["line_energy"][line], strain[element], rtol=1e-6)
    np.testing.assert_array_equal(found["line_energy"][mesh.kinds == RIGID], 0.0)
    # grid points 5 and 6 are at one place, and 6 has no line
    at = mesh.used.tolist().index(4)
    np.testing.assert_allclose(found["energy"][at], strain["31"], rtol=1e-6)
    np.testing.assert_array_equal(np.delete(found["energy"], at, axis=0), 0.0)
    assert found["line_energy"].sum() + found["energy"].sum() == pytest.approx(300.0)


@pytest.mark.slow
def test_a_run_keeps_the_shapes_before_and_as_written(finished: tuple[Any, RunResult]) -> None:
    results = finished[1].results
    assert [m.stage for m in results.mode_shapes] == ["before", "after as written"]
    assert all(m.reason == "" for m in results.mode_shapes)


def test_the_model_at_the_sensors_is_the_motion_of_their_points(finished: tuple[Any, RunResult]) -> None:
    """Sensors Y and Z at grid points 2 to 5, and the test is made of modes of such a beam."""
    run = finished[1]
    kept = run.results.mode_shapes[-1]
    read = {name: run.arrays[key] for name, key in kept if name.endswith("_key")}
    points, motion = read["points_key"], read["translations_key"]
    rows = [int(np.flatnonzero((points == seat).all(axis=1))[0]) for seat in read["sensor_positions_key"]]
    seen = np.einsum("si,sim->sm", read["sensor_directions_key"], motion[rows])
    np.testing.assert_allclose(seen, read["model_at_sensors_key"], atol=1e-5 * np.abs(seen).max())
    assert not read["sensor_rotations_key"].any()
    assert read["test_shapes_key"].shape == (len(rows), 4)


@pytest.mark.slow
def test_of_very_large_models_a_coarser_mesh_is_kept(beam: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_shapes, "thinned", partial(thinned, most_lines=3))
    run = ft.run(beam.study())
    assert {m.reason for m in run.results.mode_shapes} == {""}
    (sentence,) = {m.simplified for m in run.results.mode_shapes}
    assert re.fullmatch("the mesh is simplified in the drawing: [123] lines instead of 4", sentence)
    assert run.report is not None
    assert sentence[1:] in run.report.read_text("utf-8")


def _sheet(n: int) -> tuple[np.ndarray, np.ndarray]:
    """n × n squares of a plate of one metre."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    return points, first[:, None] + np.array([0, 1, n + 2, n + 1])


def _area(points: np.ndarray, faces: np.ndarray) -> float:
    at = points[np.where(faces < 0, faces[:, [2]], faces)]
    return float(np.abs(0.5 * np.cross(at[:, 2] - at[:, 0], at[:, 3] - at[:, 1])[:, 2]).sum())


@pytest.mark.slow
def test_a_coarser_mesh_covers_the_same_area_within_the_limits() -> None:
    points, faces = _sheet(100)
    edges = faces[:, :2]
    mesh = DrawnMesh(edges, np.zeros(len(edges), np.int64), faces)
    assert thinned(points, mesh) is not mesh
    fewer = thinned(points, mesh, 4000, 2500)
    assert 500 < len(fewer.faces) <= 2500
    assert len(fewer.lines) <= 4000
    assert _area(points, fewer.faces) > 0.9
    assert fewer.sentence.startswith(
        f"the mesh is simplified in the drawing: {len(fewer.faces)} faces instead of 10000"
    )
    whole = DrawnMesh(edges[:9], np.zeros(9, np.int64), faces)
    assert thinned(points, whole) is whole


def test_quadrilaterals_that_lose_a_corner_are_triangles() -> None:
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 1.0, 0], [0.0, 1.0, 0], [1.01, 1.01, 0.0]])
    faces = np.array([[0, 1, 2, 3], [1, 4, 2, 3], [4, 2, 4, 2], [0, 1, 4, 3]])
    mesh = DrawnMesh(np.zeros((0, 2), np.int64), np.zeros(0, np.int64), faces)
    fewer = thinned(points, mesh, most_faces=2)
    # point 4 lies in the cell of point 2, so that the first and the last face are one
    assert {tuple(face) for face in fewer.faces.tolist()} == {(0, 1, 2, 3), (1, 2, 3, -1)}


def test_a_mesh_is_drawn_on_other_points_of_the_same_numbers(tmp_path: Path) -> None:
    """The portal on its own points in another order, without the right column's foot."""
    structure = _portal(tmp_path).model.structure
    own = structure.nodes
    some = np.array([4, 2, 0, 3])
    nodes = NodeTable(own.ids[some], own.xyz[some], own.frames[some])
    mesh = mesh_beside(structure, nodes)
    ends = {tuple(sorted(int(nodes.ids[k]) for k in line)) for line in mesh.lines}
    assert ends == {(1, 3), (3, 5), (4, 5)}


def test_shells_with_mid_side_grid_points_have_faces_between_these() -> None:
    """A rectangle of one CQUAD8 or two CTRIA6: the faces together have its area; corners alone where one is missing."""
    mesh = shell_mesh(rectangle(2.0, 1.0), 1, 1, "quad8")
    halves = shell_mesh(rectangle(2.0, 1.0), 1, 1, "right6")
    lacking = mesh.cells.copy()
    lacking[0, 5] = -1
    section = Section(Isotropic(1.0, 0.3), 0.1)
    for xyz, cells, count in ((mesh.xyz, mesh.cells, 5), (mesh.xyz, lacking, 1), (halves.xyz, halves.cells, 8)):
        structure = shell_structure(xyz, [ShellPart(cells, section)])
        faces = active_faces(structure, ())
        assert len(faces) == count
        area = 0.0
        for face in faces:
            x, y = xyz[face[face >= 0], :2].T
            area += 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
        assert area == pytest.approx(2.0)


def test_each_line_and_face_knows_its_element(tmp_path: Path) -> None:
    mesh = shell_mesh(rectangle(0.4, 0.3), 4, 3, distort=0.2)
    structure = shell_structure(mesh.xyz, [ShellPart(mesh.cells, Section(Isotropic(7e10, 0.3, 2700.0), 0.004))])
    drawn = whole_mesh(structure)
    lines, faces = elements_at(structure, (), drawn)
    assert not len(lines)
    (batch,) = [b for b in structure.batches if len(b.nodes)]
    found = {int(n): set(face[face >= 0]) for n, face in zip(faces, drawn.faces)}
    assert found == {int(n): set(nodes.tolist()) for n, nodes in zip(batch.ids, batch.nodes)}
    portal = _portal(tmp_path).model.structure
    lines, faces = elements_at(portal, (), whole_mesh(portal))
    assert sorted(lines.tolist()) == [0, 0, 1, 2]
    # of those that are on, the nearest; 0 where there are none
    assert set(elements_at(portal, (1,), whole_mesh(portal))[0]) == {0, 2}
    assert not elements_at(portal, (1, 2), whole_mesh(portal))[0].any()
