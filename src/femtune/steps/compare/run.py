"""The modes of one mesh as the test of another mesh of the same structure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.correlation.mesh_map import MeshMap, map_meshes
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.steps.modes.run import simulate_tests
from femtune.steps.modes.simulated_test import SimulatedTest
from femtune.testdata import ModalTest, WireFrame, sensors_at

if TYPE_CHECKING:
    from femtune.files.study_file import StudyFile
    from femtune.study.progress import Progress
    from femtune.study.study import Study

MORE_MODES = 6
"""Modes of the second model beyond those of the first.

Modes of two meshes can change order, so that partners of the last ones may have a higher number.
"""
_POINT_TOLERANCE = 0.01
"""Largest distance of two points that are taken as the same, relative to the diagonal of the first mesh.

It must cover different positions of nodes on a curved surface, and stay below the size of an element.
"""


def mapped_meshes(one: Study, other: Study, tolerance: float | None, most: int) -> MeshMap:
    """Common points of two meshes, as node numbers: those that can move in both.

    Raises
    ------
    FemtuneError : ``correlate.no-common-points``
    """
    sides = []
    for study in (one, other):
        nodes = study.model.structure.nodes
        if not nodes.has_coordinates:
            raise FemtuneError("correlate.no-common-points/coordinates")
        rows = _moving(study)
        sides.append((nodes.ids[rows], nodes.xyz[rows]))
    (ids, xyz), (other_ids, other_xyz) = sides
    size = float(np.linalg.norm(np.ptp(xyz, axis=0))) if len(xyz) else 0.0
    mapping = map_meshes(xyz, other_xyz, _POINT_TOLERANCE * size if tolerance is None else tolerance, most)
    return MeshMap(ids[mapping.first], other_ids[mapping.second], mapping.distance)


def _moving(study: Study) -> Integers:
    """Rows of the grid points of which a translation follows from the free DOFs of the first configuration."""
    transformation = study.cases[0].configured.transformation
    used = np.diff(transformation.tocsr().indptr) > 0
    count = len(study.model.structure.nodes.ids)
    return np.flatnonzero(used[: 6 * count].reshape(count, 6)[:, :3].any(axis=1))


def modes_on_other_mesh(
    source: Path | str | StudyFile,
    other: Study,
    points: MeshMap,
    units: str | None,
    progress: Progress,
    **wanted: float | None,
) -> ModalTest:
    """The elastic modes of a mesh at the common points, which have the numbers and places of the other mesh.

    Raises
    ------
    FemtuneError : as `simulate_tests`
    """
    sensors = tuple(f"{node}:123" for node in points.first)
    test = simulate_tests(source, SimulatedTest(None, sensors, units), progress, **wanted)[0]  # type: ignore[arg-type]
    assert test.modes is not None
    number: Mapping[int, int] = dict(zip(map(int, points.first), map(int, points.second)))
    nodes = other.model.structure.nodes
    place: dict[int, Reals] = {int(n): nodes.xyz[nodes.position(int(n))] for n in points.second}
    ids = np.array([number[int(n)] for n in test.geometry.nodes])
    order, axes = np.argsort(ids), test.geometry.axes
    assert axes is not None
    frame = WireFrame(ids[order], np.array([place[int(n)] for n in ids[order]]), axes[order])
    dofs = DofSet(tuple(Dof(number[d.node], d.direction) for d in test.modes.dofs))
    modes = replace(test.modes, dofs=dofs, source="modes of the first model")
    return ModalTest("first model", test.units, frame, sensors_at(frame, dofs), modes=modes)
