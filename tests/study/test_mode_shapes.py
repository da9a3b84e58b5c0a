"""Shapes kept for drawing: lines of active elements, motion in basic axes, sensors where they sit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from femtune import steps
from femtune.files.nastran import read_deck
from femtune.files.nastran.build import build_structure
from femtune.model import Configuration, ConfiguredModel, configure, parametric_model, solve_modes
from femtune.parameters import ParameterSet
from femtune.study import RunFolder, record_shapes
from femtune.study.record_shapes import active_lines, grid_translations

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
    model = parametric_model(build_structure(read_deck(path)).structure, ParameterSet(()), ())
    return configure(model, Configuration(elements_off=off))


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
    lines, kinds = active_lines(_portal(tmp_path, off=off))
    ends = [(int(a) + 1, int(b) + 1) for a, b in lines]
    assert {e for e, kind in zip(ends, kinds) if kind == record_shapes.ELEMENT} == elements
    assert {e for e, kind in zip(ends, kinds) if kind == record_shapes.RIGID} == rigid


def test_motion_is_in_basic_axes_whatever_the_displacement_frames(tmp_path: Path) -> None:
    """The same structure with its displacements in a skew system moves alike, up to the sign of a mode."""
    found = []
    for cd in ("", "7"):
        configured = _portal(tmp_path, cd)
        found.append(grid_translations(configured, solve_modes(configured.at(np.zeros(0)), 3)))
    plain, skew = found
    signs = np.sign(np.einsum("nim,nim->m", plain, skew))
    np.testing.assert_allclose(skew * signs, plain, atol=1e-9 * np.abs(plain).max())


def test_a_run_keeps_the_shapes_before_and_as_written(finished: tuple[Any, RunFolder]) -> None:
    results = finished[1].results
    assert [m.stage for m in results.mode_shapes] == ["before", "after as written"]
    assert all(m.reason == "" for m in results.mode_shapes)


def test_the_model_at_the_sensors_is_the_motion_of_their_points(finished: tuple[Any, RunFolder]) -> None:
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


def test_very_large_models_are_left_out_with_a_sentence(beam: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_shapes, "MOST_LINES", 3)
    run = steps.run(beam.study())
    assert {m.reason for m in run.results.mode_shapes} == {
        "the model has 4 lines, and shapes are kept for drawing up to 3"
    }
    assert run.report is not None
    assert "Not drawn: the model has 4 lines" in run.report.read_text("utf-8")
