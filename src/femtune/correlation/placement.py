"""Effect of errors in the position and direction of sensors on measured shapes.

A sensor of direction d that is displaced by δ and tilted by the small rotation α reads d·u + g·δ + (d × u)·α instead of
d·u, with the gradient g = ∂(d·u)/∂x of the motion along the structure. Both errors are those of the test node: its
sensors share them. With independent components of standard deviations σ_x and σ_α the covariance of two sensors of a
node is

    σ_x² g_a·g_b + σ_α² (d_a × u)·(d_b × u),

and that of sensors of different nodes is zero.

The gradient at a grid point comes from the rotation θ there and from the neighbours j along the elements: for motion
normal to the mesh g = P (d_n × θ), for motion along the mesh the least-squares solution of g·r_j = d·(u_j − u). P
projects on the directions that the neighbours span (the axis of a beam, the plane of a shell): a sensor stays on the
structure.
Without rotations, as in solids, the neighbours give all of it; on a rigid body without elements the rotation does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from femtune.arrays import Integers, Reals
from femtune.correlation.sensor_map import SensorMap
from femtune.dofs import DofSet
from femtune.fem import Structure
from femtune.fem.elements import KINDS
from femtune.model import ConfiguredModel

_SPANNED = 0.25
"""Directions of the neighbours whose singular value is below this part of the largest one are not along the mesh."""


@dataclass(frozen=True, eq=False)
class SensorPlacement:
    """How the readings of the sensors depend on their positions and directions.

    Parameters
    ----------
    dofs : labels of the s sensors
    nodes : (s,) test nodes
    position_sd : (s,) standard deviation of each coordinate of the position, a length
    angle_sd : (s,) standard deviation of the rotation about each axis, rad
    gradient : (3s, n_g) sparse: from g-set displacements to g of each sensor, in basic axes
    tilt : (3s, n_g) sparse, to d × u
    """

    dofs: DofSet
    nodes: Integers
    position_sd: Reals
    angle_sd: Reals
    gradient: sp.csr_array
    tilt: sp.csr_array

    def covariance(self, motion: Reals) -> Reals:
        """(s, s) covariance of the readings of a motion (n_g,), in the square of its unit."""
        covariance = np.zeros((len(self.nodes),) * 2)
        for rows, sd in ((self.gradient, self.position_sd), (self.tilt, self.angle_sd)):
            slopes = np.asarray(rows @ motion).reshape(-1, 3) * sd[:, None]
            covariance += slopes @ slopes.T
        return np.where(self.nodes[:, None] == self.nodes[None, :], covariance, 0.0)


def sensor_placement(
    configured: ConfiguredModel,
    sensors: SensorMap,
    position_sd: float | Mapping[int, float],
    angle_sd: float | Mapping[int, float] = 0.0,
) -> SensorPlacement:
    """The dependence on position and direction of all sensors that sit on a grid point; others have none.

    Parameters
    ----------
    position_sd : of all test nodes, or by test node; 0 for those that are not named
    angle_sd : likewise, rad
    """
    structure = configured.model.structure
    near = _Neighbours(structure, frozenset(configured.configuration.elements_off))
    turning = _turning(configured)
    parts = [_rows(structure, sensors, i, near, turning) for i in range(len(sensors.matches))]
    nodes = np.array([m.label.node for m in sensors.matches], dtype=np.int64)
    gradient, tilt = (_stacked([part[k] for part in parts], structure.nodes.n_dofs) for k in (0, 1))
    return SensorPlacement(sensors.dofs, nodes, _sds(nodes, position_sd), _sds(nodes, angle_sd), gradient, tilt)


def _sds(nodes: Integers, given: float | Mapping[int, float]) -> Reals:
    if isinstance(given, Mapping):
        return np.array([float(given.get(int(n), 0.0)) for n in nodes])
    return np.full(len(nodes), float(given))


_Entries = list[tuple[int, int, float]]
"""Row 0 … 2, DOF of the g-set, value."""


def _stacked(parts: list[_Entries], width: int) -> sp.csr_array:
    entries = [(3 * i + row, dof, value) for i, part in enumerate(parts) for row, dof, value in part]
    rows, columns, values = zip(*entries) if entries else ((), (), ())
    return sp.csr_array((np.array(values, float), (rows, columns)), shape=(3 * len(parts), width))


def _turning(configured: ConfiguredModel) -> set[int]:
    """Rows of the grid points whose rotations are degrees of freedom."""
    moves = np.diff(sp.csr_array(configured.transformation).indptr) > 0
    count = len(configured.model.structure.nodes.ids)
    return set(np.flatnonzero(moves[: 6 * count].reshape(count, 6)[:, 3:].any(axis=1)).tolist())


class _Neighbours:
    """Grid points that share a beam, shell or solid with a grid point."""

    def __init__(self, structure: Structure, off: frozenset[int]) -> None:
        self._batches = []
        for batch in structure.batches:
            kind = KINDS[batch.kind]
            if kind.line or kind.faces or kind.sides:
                nodes = batch.nodes[:, :2] if kind.line else batch.nodes
                self._batches.append(nodes[~np.isin(batch.ids, list(off))])

    def of(self, at: int) -> list[int]:
        """Their rows."""
        neighbours: set[int] = set()
        for nodes in self._batches:
            neighbours |= set(nodes[(nodes == at).any(axis=1)].ravel().tolist())
        return sorted(neighbours - {at, -1})


def _rows(
    structure: Structure, sensors: SensorMap, i: int, near: _Neighbours, turning: set[int]
) -> tuple[_Entries, _Entries]:
    match, nodes = sensors.matches[i], structure.nodes
    if match.node is None or match.label.component == 0:
        return [], []
    at = nodes.position(match.node)
    first = 3 if match.label.component > 3 else 0
    d = nodes.frames[at] @ sensors.matrix[[i], 6 * at + first : 6 * at + first + 3].toarray()[0]

    def field(node: int, weights: Reals, offset: int) -> _Entries:
        """Entries of weights (3, 3) @ the basic translations (offset 0) or rotations (3) of a node."""
        local = weights @ nodes.frames[node]
        return [
            (row, 6 * node + offset + k, float(local[row, k])) for row in range(3) for k in range(3) if local[row, k]
        ]

    others = near.of(at)
    arms = nodes.xyz[others] - nodes.xyz[at]
    lengths = np.linalg.norm(arms, axis=1)
    others, arms, lengths = [o for o, n in zip(others, lengths) if n > 0.0], arms[lengths > 0.0], lengths[lengths > 0.0]
    plane, inverse = _spanned(arms / lengths[:, None])
    by_rotation = first == 0 and at in turning
    if by_rotation and not others:
        plane = np.eye(3)
    along = plane @ d if by_rotation and others else d
    gradient: _Entries = []
    for j, o in enumerate(others):
        weights = np.outer(inverse[:, j], along) / lengths[j]
        gradient += field(o, weights, first) + field(at, -weights, first)
    if by_rotation:
        gradient += field(at, plane @ _cross(d - along if others else d), 3)
    return gradient, field(at, _cross(d), first)


def _spanned(directions: Reals) -> tuple[Reals, Reals]:
    """Projector (3, 3) on what unit vectors (m, 3) span, and their pseudo-inverse (3, m) there."""
    if not len(directions):
        return np.zeros((3, 3)), np.zeros((3, 0))
    U, values, V = np.linalg.svd(directions, full_matrices=False)
    kept = values > _SPANNED * values[0]
    return V[kept].T @ V[kept], (V[kept].T / values[kept]) @ U[:, kept].T


def _cross(d: Reals) -> Reals:
    """The matrix of d × ·."""
    return np.array([[0.0, -d[2], d[1]], [d[2], 0.0, -d[0]], [-d[1], d[0], 0.0]])
