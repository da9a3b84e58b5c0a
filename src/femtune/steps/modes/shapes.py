"""Mode shapes for drawing, as records and arrays."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from femtune.fem.elements import KINDS
from femtune.selection import strain_shares
from femtune.study.drawn_mesh import elements_at, thinned, whole_mesh
from femtune.study.record import ModelVersion

if TYPE_CHECKING:
    from femtune.correlation import SensorMap
    from femtune.fem.structure import NodeTable
    from femtune.model import ConfiguredModel, EigenSolution
    from femtune.study.cases import StudyCase
    from femtune.study.drawn_mesh import DrawnMesh
    from femtune.testdata import WireFrame
from femtune.steps.modes.record import ModeShapes

_ENTRIES_PER_BATCH = 30_000_000
"""Entries of the shapes (240 MB) for which the strain energies are computed in one batch.

It bounds the memory for temporary arrays.
"""


Arrays = dict[str, NDArray]


MOST_MODES = 50
"""Modes whose shapes are stored for the page; the size of the results grows with them."""


def mode_shapes(
    case: StudyCase, version: ModelVersion, solution: EigenSolution, prefix: str, arrays: Arrays
) -> ModeShapes:
    """The record; its arrays go into `arrays` under `prefix`. Large models are stored with a simplified
    mesh, very many modes not at all."""
    mesh = case.mesh or drawn_mesh(case.configured)
    reason = _not_drawn(mesh, solution.wanted)
    if reason:
        return ModeShapes(configuration=case.name, stage=version, reason=reason)
    rows = mesh.used
    stored: Arrays = {
        **_geometry(case.configured, mesh),
        "translations": grid_translations(case.configured, solution, rows),
        **element_shares(case.configured, solution, mesh),
        **_measured(case, solution),
    }
    return _stored(case, version, mesh, stored, f"{prefix}/shapes", arrays)


@dataclass(frozen=True, eq=False)
class ShapeRows:
    """What is shown of a shape on the free DOFs: `matrix` (3p + s, n_free) has the translations of the p points of
    the mesh in basic axes, point by point, and the motion of the s sensors of the modes."""

    mesh: DrawnMesh
    matrix: sp.csr_array


def shape_rows(case: StudyCase) -> ShapeRows:
    """Those of a configuration; without points and sensors where it has nothing to draw."""
    configured, mesh = case.configured, case.mesh or drawn_mesh(case.configured)
    rows = mesh.used
    dofs = (6 * rows[:, None] + np.arange(3)).ravel()
    place = np.arange(len(dofs))
    frames = configured.model.structure.nodes.frames[rows]
    column = np.repeat(place.reshape(-1, 1, 3), 3, axis=1)
    turn = sp.csr_array((frames.ravel(), (np.repeat(place, 3), column.ravel())), shape=(len(dofs), len(dofs)))
    seen = [] if case.modal is None or not len(rows) else [case.modal.sensors]
    return ShapeRows(mesh, sp.csr_array(sp.vstack([turn @ configured.transformation[dofs], *seen])))


def complex_mode_shapes(
    case: StudyCase, version: ModelVersion, shown: ShapeRows, motion: NDArray, prefix: str, arrays: Arrays
) -> ModeShapes:
    """The record of complex modes; `motion` (3p + s, m) are their shapes as `shown` sees them."""
    reason = _not_drawn(shown.mesh, motion.shape[1])
    if reason:
        return ModeShapes(configuration=case.name, stage=version, reason=reason)
    points = len(shown.mesh.used)
    stored = {
        **_geometry(case.configured, shown.mesh),
        "translations": motion[: 3 * points].reshape(points, 3, -1),
        **({} if case.modal is None else {"model_at_sensors": motion[3 * points :]}),
    }
    return _stored(case, version, shown.mesh, stored, f"{prefix}/complex_shapes", arrays)


def _geometry(configured: ConfiguredModel, mesh: DrawnMesh) -> Arrays:
    counted = mesh.counted_from(mesh.used)
    lines, faces = elements_at(configured.model.structure, configured.configuration.elements_off, mesh)
    return {
        "points": configured.model.structure.nodes.xyz[mesh.used],
        "point_numbers": configured.model.structure.nodes.ids[mesh.used].astype(np.int64),
        "lines": counted.lines.astype(np.int32),
        "line_kinds": counted.kinds.astype(np.int8),
        "faces": counted.faces.astype(np.int32),
        "line_elements": lines.astype(np.int32),
        "face_elements": faces.astype(np.int32),
    }


_SINGLE_PRECISION = {np.dtype(float): np.float32, np.dtype(complex): np.complex64}
"""Types in which shapes are stored: single precision is enough for pictures."""


def _stored(
    case: StudyCase, version: ModelVersion, mesh: DrawnMesh, stored: Arrays, prefix: str, arrays: Arrays
) -> ModeShapes:
    """The record of arrays, which are put away in single precision."""
    arrays |= {f"{prefix}/{name}": a.astype(_SINGLE_PRECISION.get(a.dtype, a.dtype)) for name, a in stored.items()}
    keys = {f"{name}_key": f"{prefix}/{name}" for name in stored}
    record = {"configuration": case.name, "stage": version, "simplified": mesh.sentence, **keys}
    return ModeShapes.model_validate(record)


def drawn_mesh(configured: ConfiguredModel) -> DrawnMesh:
    """Lines and faces of the active elements, no more than pictures can show."""
    structure = configured.model.structure
    return thinned(structure.nodes.xyz, whole_mesh(structure, configured.configuration.elements_off))


def _not_drawn(mesh: DrawnMesh, modes: int) -> str:
    if not len(mesh.lines) and not len(mesh.faces):
        return "the model has no shells, no solids and no two-node or rigid elements to draw"
    return f"there are {modes} modes, and shapes are stored for up to {MOST_MODES}" if modes > MOST_MODES else ""


def grid_translations(
    configured: ConfiguredModel, solution: EigenSolution, rows: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """(grid points, 3, modes) motion of the wanted modes in basic axes, at some rows of the grid points or at all."""
    nodes = configured.model.structure.nodes
    rows = np.arange(len(nodes.ids)) if rows is None else rows
    return _in_basic_axes(configured, solution.shapes[:, : solution.wanted], rows, np.arange(3))


def grid_motion(configured: ConfiguredModel, shapes: NDArray) -> NDArray[np.float64]:
    """(grid points, 6, modes) translations and rotations in basic axes of shapes on the free DOFs (n_free, modes); a
    shape with NaN entries is NaN throughout."""
    rows, known = np.arange(len(configured.model.structure.nodes.ids)), np.isfinite(shapes).all(axis=0)
    filled = np.where(known, shapes, 0.0)
    motion = np.concatenate([_in_basic_axes(configured, filled, rows, k + np.arange(3)) for k in (0, 3)], axis=1)
    motion[:, :, ~known] = np.nan
    return motion


def _in_basic_axes(
    configured: ConfiguredModel, shapes: NDArray, rows: NDArray[np.int64], components: NDArray[np.int64]
) -> NDArray[np.float64]:
    motion = configured.transformation[(6 * rows[:, None] + components).ravel()] @ shapes
    return np.einsum("nij,njm->nim", configured.model.structure.nodes.frames[rows], motion.reshape(len(rows), 3, -1))


def element_shares(configured: ConfiguredModel, solution: EigenSolution, mesh: DrawnMesh) -> dict[str, NDArray]:
    """Shares of the elements in the strain energy, %, of the lines that are drawn, and of all else at the points."""
    most = max(1, _ENTRIES_PER_BATCH // solution.shapes.shape[0])
    parts = [
        strain_shares(solution, range(first, min(first + most, solution.wanted)))
        for first in range(0, solution.wanted, most)
    ]
    numbers = parts[0][0] if parts else np.zeros(0, np.int64)
    if not len(numbers):
        return {}
    # as many digits as are kept
    shares = np.hstack([part.astype(np.float32) for _, part in parts])
    percent, rows = 100.0 * np.nan_to_num(np.maximum(shares, 0.0)), mesh.used
    of_lines = np.zeros((len(mesh.lines), solution.wanted))
    element, row = [], []
    for batch in configured.model.structure.batches:
        at = np.minimum(np.searchsorted(numbers, batch.ids), len(numbers) - 1)
        known = numbers[at] == batch.ids
        is_line = KINDS[batch.kind].line and batch.nodes.shape[1] > 1
        line = mesh.line_of(batch.nodes[:, :2]) if is_line else np.full(len(at), -1)
        drawn = known & (line >= 0)
        np.add.at(of_lines, line[drawn], percent[at[drawn]])
        corner = (batch.nodes >= 0) & (known & ~drawn)[:, None]
        element.append(np.broadcast_to(at[:, None], corner.shape)[corner])
        row.append(batch.nodes[corner])
    at_points = _at_points(configured, rows, np.concatenate(row))
    of_points = np.zeros((solution.wanted, len(rows)))
    for mode, of in zip(of_points, percent.T):
        np.maximum.at(mode, at_points, of[np.concatenate(element)])
    return {"energy": of_points.T, "line_energy": of_lines}


def _at_points(configured: ConfiguredModel, rows: NDArray[np.int64], of: NDArray[np.int64]) -> NDArray[np.int64]:
    """The position in `rows` of each grid point `of`; of one that is not drawn, that of the nearest one that is."""
    xyz = configured.model.structure.nodes.xyz
    seen_at = np.arange(len(xyz))
    hidden = np.setdiff1d(of, rows)
    seen_at[hidden] = rows[cKDTree(xyz[rows]).query(xyz[hidden])[1]]
    return np.searchsorted(rows, seen_at[of])


def drawn_rows(case: StudyCase, solution: EigenSolution) -> NDArray[np.int32] | None:
    """Rows of the grid points that `mode_shapes` draws, in its order; None where it draws nothing."""
    mesh = case.mesh or drawn_mesh(case.configured)
    return None if _not_drawn(mesh, solution.wanted) else np.asarray(mesh.used, dtype=np.int32)


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
        "sensor_nodes": np.array([m.label.node for m in case.sensors.matches], dtype=np.int64),
        "sensor_rotations": np.array([m.label.component > 3 for m in case.sensors.matches], dtype=np.int8),
        "wire": _wire(case.test.geometry, case.sensors).astype(np.int32),
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


def _wire(geometry: WireFrame, sensors: SensorMap) -> NDArray[np.int64]:
    """(wires, 2) the first sensor of the nodes at both ends, of the trace lines and elements of the test.

    Lines to a node without a sensor are left out, since its motion is not known.
    """
    first: dict[int, int] = {}
    for row, match in enumerate(sensors.matches):
        first.setdefault(match.label.node, row)
    closed = [(*nodes, nodes[0]) if len(nodes) > 2 else nodes for nodes in geometry.elements]
    steps = {(min(a, b), max(a, b)) for nodes in (*geometry.lines, *closed) for a, b in pairwise(nodes) if a != b}
    edges = [(first[a], first[b]) for a, b in sorted(steps) if a in first and b in first]
    return np.array(edges, dtype=np.int64).reshape(-1, 2)
