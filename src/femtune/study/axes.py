"""Inputs and outputs of responses: grid points, combinations and sensors of the test, as rows over the model's DOFs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import DofSet, parse_dof
from femtune.errors import ErrorCollector, FemtuneError, Notice
from femtune.study.error_places import errors_at
from femtune.study.measured import combinations

if TYPE_CHECKING:
    from femtune.dofs import Dof
    from femtune.fem import NodeTable
    from femtune.files.study_file import StudyFile
    from femtune.model import ConfiguredModel
    from femtune.study.cases import StudyCase

_SAME_MOTION = 1e-9
"""Relative difference of two rows of a transformation below which they are the same motion: it covers rounding only."""
_MOST_DOFS_SHOWN = 8
"""DOFs that a notice names; the others are counted."""


@dataclass(frozen=True, eq=False)
class Axis:
    """DOFs and combinations with their rows (n, n_g); `of_test` is True if the labels are those of the test."""

    labels: DofSet
    rows: sp.csr_array
    of_test: bool = False


def named_axis(file: StudyFile, case: StudyCase, labels: Sequence[str], *place: str | int) -> Axis:
    """Labels of the study: a [[sensor]] or [[rigid_floor]] of that name, else a grid point's DOF.

    Raises
    ------
    FemtuneError : ``model.unknown-node``, ``model.component``, ``response.held-port``, ``dof.duplicate``
    """
    configured = case.configured
    structure = configured.model.structure
    known = {(c.dof.node, c.dof.direction): c for c in combinations(file, structure)}
    errors, rows = ErrorCollector(), sp.lil_array((len(labels), structure.nodes.n_dofs))
    dofs = [parse_dof(label) for label in labels]
    for i, dof in enumerate(dofs):
        with errors.catch(), errors_at(file.where(*place, i)):
            sensor = known.get((dof.node, dof.direction))
            terms = sensor.terms if sensor is not None else ((dof.node, dof.component, 1.0),)
            sign = dof.sign * (sensor.dof.sign if sensor is not None else 1)
            for at, factor in _terms(structure.nodes, terms):
                rows[i, at] += sign * factor
            _check_free(configured, dof, sp.csr_array(rows[[i]]))
    errors.raise_if_any()
    with errors_at(file.where(*place)):
        return Axis(DofSet(dofs), sp.csr_array(rows))


def _terms(nodes: NodeTable, terms: Sequence[tuple[int, int, float]]) -> list[tuple[int, float]]:
    return [(nodes.dof(node, component), factor) for node, component, factor in terms]


def _check_free(configured: ConfiguredModel, dof: Dof, row: sp.csr_array) -> None:
    if not _moves(configured, row)[0]:
        raise FemtuneError("response.held-port/one-dof", configuration=configured.configuration.name, dof=dof)


def _moves(configured: ConfiguredModel, rows: sp.csr_array) -> NDArray[np.bool_]:
    """(n,) True for combinations that some free DOF moves."""
    reach = np.asarray(np.abs(rows @ configured.transformation).sum(axis=1))
    return np.asarray(reach > 1e-14 * np.asarray(np.abs(rows).sum(axis=1)))


def sensor_axis(case: StudyCase, wanted: DofSet) -> tuple[Axis, tuple[Notice, ...]]:
    """DOFs of the test that exist in the model and can move, in their order; notices name the others."""
    assert case.all_sensors is not None
    sensors = case.all_sensors
    placed = wanted.common(sensors.dofs)
    at, signs = placed.align(sensors.dofs)
    rows = sp.csr_array(sp.diags_array(signs) @ sensors.matrix[at]) if len(placed) else sp.csr_array(sensors.matrix[at])
    free = _moves(case.configured, rows)
    lost = [d for d in wanted if d not in placed]
    held = [d for d, moves in zip(placed, free) if not moves]
    notices = _left_out(case, lost, "are not assigned to the model") + _left_out(
        case, held, "are constrained in the model"
    )
    return Axis(placed.select(np.flatnonzero(free)), sp.csr_array(rows[np.flatnonzero(free)]), True), notices


def _left_out(case: StudyCase, dofs: Sequence[Dof], why: str) -> tuple[Notice, ...]:
    if not dofs:
        return ()
    names = ", ".join(map(str, dofs[:_MOST_DOFS_SHOWN])) + (
        f" and {len(dofs) - _MOST_DOFS_SHOWN} more" if len(dofs) > _MOST_DOFS_SHOWN else ""
    )
    return (Notice("response.left-out", configuration=case.name, n_dofs=len(dofs), reason=why, names=names),)


def same_motion(a: sp.csr_array, b: sp.csr_array) -> NDArray[np.float64]:
    """(n_a, n_b) +1 or −1 where two rows are equal except for that sign, 0 elsewhere."""
    products = np.asarray((a @ b.T).todense(), dtype=float)
    size_a, size_b = (np.sqrt(np.asarray(m.multiply(m).sum(axis=1), dtype=float)) for m in (a, b))
    alike = np.abs(size_a[:, None] - size_b[None, :]) <= _SAME_MOTION * size_a[:, None]
    parallel = np.abs(products) >= (1.0 - _SAME_MOTION) * size_a[:, None] * size_b[None, :]
    return np.where(alike & parallel, np.sign(products), 0.0)


def seen_as(axis: Axis, case: StudyCase, measured: DofSet) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each DOF of an axis the position among the measured ones (−1: none), and the sign between the two."""
    if axis.of_test:
        known = [i for i, d in enumerate(axis.labels) if d in measured]
        at, signs = np.full(len(axis.labels), -1), np.zeros(len(axis.labels))
        at[known], signs[known] = axis.labels.select(known).align(measured)
        return at, signs
    placed, _ = sensor_axis(case, measured)
    same = same_motion(axis.rows, placed.rows)
    to_measured = placed.labels.align(measured)[0]
    matched = same.any(axis=1) if same.size else np.zeros(len(axis.labels), bool)
    first = np.argmax(same != 0.0, axis=1) if same.size else np.zeros(len(axis.labels), np.int64)
    at = np.where(matched, to_measured[first] if len(to_measured) else -1, -1)
    signs = same[np.arange(len(first)), first] if same.size else np.zeros(len(axis.labels))
    return at, signs
