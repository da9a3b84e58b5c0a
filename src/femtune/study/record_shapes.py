"""Mode shapes for pictures: lines and faces of the active elements, motion of all grid points, the test's motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.correlate import SensorMap
from femtune.fem import ConstraintRows, ElementBatch, Structure
from femtune.fem.structure import NodeTable
from femtune.model import ConfiguredModel, EigenSolution
from femtune.study.cases import StudyCase
from femtune.study.drawn_mesh import DrawnMesh, outer_faces, thinned
from femtune.study.results_base import Stage
from femtune.study.results_shapes import ModeShapes

Arrays = dict[str, NDArray]

MOST_MODES = 50
ELEMENT, RIGID = 0, 1
_LINE_KINDS = ("bar", "tapered-beam", "rod", "spring", "bush", "dashpot", "line-dashpot", "line-spring")
_FACES = {
    "shell-quad": ((0, 1, 2, 3),),
    "shell-tri": ((0, 1, 2, -1),),
    "shear-panel": ((0, 1, 2, 3),),
    "shell-quad8": ((0, 4, 7, -1), (1, 5, 4, -1), (2, 6, 5, -1), (3, 7, 6, -1), (4, 5, 6, 7)),
    "shell-tri6": ((0, 3, 5, -1), (1, 4, 3, -1), (2, 5, 4, -1), (3, 4, 5, -1)),
}
"""Faces of a shell by place in its element, −1 for the fourth corner of a triangle."""


def mode_shapes(case: StudyCase, stage: Stage, solution: EigenSolution, prefix: str, arrays: Arrays) -> ModeShapes:
    """The record; its arrays go into `arrays` under `prefix`. Of large models a coarser mesh is kept, of very many
    modes none."""
    mesh = drawn_mesh(case.configured)
    reason = _not_drawn(mesh, solution.wanted)
    if reason:
        return ModeShapes(configuration=case.name, stage=stage, reason=reason)
    rows = mesh.used
    counted = mesh.counted_from(rows)
    found: Arrays = {
        "points": case.configured.model.structure.nodes.xyz[rows],
        "lines": counted.lines.astype(np.int32),
        "line_kinds": counted.kinds.astype(np.int8),
        "faces": counted.faces.astype(np.int32),
        "translations": grid_translations(case.configured, solution, rows),
        **_measured(case, solution),
    }
    small = {name: a.astype(np.float32) if a.dtype == float else a for name, a in found.items()}
    arrays |= {f"{prefix}/shapes/{name}": a for name, a in small.items()}
    keys = {f"{name}_key": f"{prefix}/shapes/{name}" for name in found}
    record = {"configuration": case.name, "stage": stage, "simplified": mesh.sentence, **keys}
    return ModeShapes.model_validate(record)


def drawn_mesh(configured: ConfiguredModel) -> DrawnMesh:
    """Lines and faces of the active elements, no more than pictures can show."""
    mesh = DrawnMesh(*active_lines(configured), active_faces(configured))
    return thinned(configured.model.structure.nodes.xyz, mesh)


def _not_drawn(mesh: DrawnMesh, modes: int) -> str:
    if not len(mesh.lines) and not len(mesh.faces):
        return "the model has no shells, no solids and no two-node or rigid elements to draw"
    return f"there are {modes} modes, and shapes are kept up to {MOST_MODES}" if modes > MOST_MODES else ""


def active_lines(configured: ConfiguredModel) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the grid points at both ends, (lines, 2), and the kind of each line, of a configuration's elements."""
    structure = configured.model.structure
    off = list(configured.configuration.elements_off)
    elements = [_batch_lines(b, off) for b in structure.batches if b.kind in _LINE_KINDS]
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, off))
    first = _drawable(structure, np.concatenate([np.zeros((0, 2), np.int64), *elements]))
    second = _drawable(structure, _rigid_lines(rigid, len(structure.nodes.ids)))
    kinds = np.repeat([ELEMENT, RIGID], [len(first), len(second)])
    return np.concatenate([first, second]), kinds


def active_faces(configured: ConfiguredModel) -> NDArray[np.int64]:
    """Rows of the grid points at the corners of active shells and of the outside of active solids, (faces, 4).

    −1 stands for the fourth corner of a triangle. A shell with mid-side grid points has some faces, with the corners
    alone where one of these is left out.
    """
    off, batches = list(configured.configuration.elements_off), configured.model.structure.batches
    shells = [_batch_faces(b, off) for b in batches if b.kind in _FACES]
    solids = outer_faces([(b, ~np.isin(b.ids, off)) for b in batches])
    return np.concatenate([np.zeros((0, 4), np.int64), *shells, solids])


def _batch_faces(batch: ElementBatch, off: list[int]) -> NDArray[np.int64]:
    nodes = batch.nodes[~np.isin(batch.ids, off)]
    lacking = (nodes < 0).any(axis=1)
    corners = nodes[lacking, : nodes.shape[1] // 2]
    # the place −1 is the column after the last
    whole = np.pad(nodes[~lacking], ((0, 0), (0, 1)), constant_values=-1)
    faces = whole[:, np.array(_FACES[batch.kind])].reshape(-1, 4)
    return np.concatenate([faces, np.pad(corners, ((0, 0), (0, 4 - corners.shape[1])), constant_values=-1)])


def _batch_lines(batch: ElementBatch, off: list[int]) -> NDArray[np.int64]:
    return batch.nodes[~np.isin(batch.ids, off), :2] if batch.nodes.shape[1] >= 2 else np.zeros((0, 2), np.int64)


def _rigid_lines(rigid: ConstraintRows, n_grids: int) -> NDArray[np.int64]:
    """From the grid point of each eliminated DOF to the others of its equation."""
    grid = np.where(rigid.dof < 6 * n_grids, rigid.dof // 6, -1)
    own = rigid.dependent[rigid.row]
    return np.column_stack([np.where(own < 6 * n_grids, own // 6, -1), grid])


def _drawable(structure: Structure, lines: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each line once; none to ground, to scalar points, or of no length."""
    xyz = structure.nodes.xyz
    lines = np.unique(np.sort(lines, axis=1), axis=0)
    lines = lines[(lines >= 0).all(axis=1) & (lines < len(xyz)).all(axis=1)]
    return lines[np.linalg.norm(xyz[lines[:, 1]] - xyz[lines[:, 0]], axis=1) > 0.0]


def grid_translations(
    configured: ConfiguredModel, solution: EigenSolution, rows: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """(grid points, 3, modes) motion of the wanted modes in basic axes, at some rows of the grid points or at all."""
    nodes = configured.model.structure.nodes
    rows = np.arange(len(nodes.ids)) if rows is None else rows
    at = (6 * rows[:, None] + np.arange(3)).ravel()
    own = (configured.transformation[at] @ solution.shapes[:, : solution.wanted]).reshape(len(rows), 3, -1)
    return np.einsum("nij,njm->nim", nodes.frames[rows], own)


def _measured(case: StudyCase, solution: EigenSolution) -> dict[str, NDArray]:
    if case.modal is None or case.sensors is None or case.test is None:
        return {}
    places = {(s.label.node, s.label.direction): s.position for s in case.test.sensors}
    known = [places.get((m.label.node, m.label.direction), np.full(3, np.nan)) for m in case.sensors.matches]
    nodes = case.configured.model.structure.nodes
    seats = [_seat(case.sensors, i, known[i], nodes) for i in range(len(known))]
    return {
        "sensor_positions": np.array([s[0] for s in seats]).reshape(-1, 3),
        "sensor_directions": np.array([s[1] for s in seats]).reshape(-1, 3),
        "sensor_rotations": np.array([m.label.component > 3 for m in case.sensors.matches], dtype=np.int8),
        "test_shapes": case.modal.test.shapes,
        "model_at_sensors": case.modal.sensors @ solution.shapes[:, : solution.wanted],
    }


def _seat(sensors: SensorMap, i: int, known: NDArray, nodes: NodeTable) -> tuple[NDArray, NDArray]:
    """Place and direction of a sensor: on the grid point it was matched with; a combination where the test says."""
    match = sensors.matches[i]
    if match.label.component == 0:
        return np.full(3, np.nan), np.zeros(3)
    if match.node is None:
        return known, match.label.sign * np.eye(3)[(match.label.component - 1) % 3]
    at = nodes.position(match.node)
    first = 6 * at + (3 if match.label.component > 3 else 0)
    return nodes.xyz[at], nodes.frames[at] @ sensors.matrix[[i], first : first + 3].toarray()[0]
