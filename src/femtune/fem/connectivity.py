"""How a structure is connected: parts that nothing connects, points in one place, repeated elements, shell normals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from femtune.arrays import Integers, Reals
from femtune.fem.structure import ConstraintRows, ElementBatch, Structure, join_constraints

SHELLS = ("CQUAD4", "CTRIA3", "CQUADR", "CTRIAR", "CQUAD8", "CTRIA6")
SOLIDS = ("CHEXA", "CPENTA", "CTETRA", "CPYRAM")
"""Cards of elements whose meshes share their grid points."""
_TRIANGLES = ("CTRIA3", "CTRIAR", "CTRIA6")
_SAME_PLACE = 1e-5
"""Distance, relative to the diagonal of the model, up to which two points are in one place: rounding of coordinates."""
_MOST_PAIRS = 1_000_000
"""Pairs of coincident points beyond which the tolerance does not fit the model, and nothing is reported."""
_COPLANAR = 0.7
"""Cosine of the angle between two shells up to which the sides of both are compared; a corner has no common normal."""
_MASS_KINDS = ("concentrated-mass", "scalar-mass", "line-mass")


@dataclass(frozen=True, eq=False)
class Connectivity:
    """Points are the rows of the grid points, and after them the scalar points.

    Parameters
    ----------
    part : (p,) number of the part that each point belongs to; parts are connected by elements and equations
    linked : (p,) number of the group that equations and elements other than shells and solids connect
    stiff : (p,) True for points of elements with stiffness
    meshed : (p,) True for points of shells and solids
    """

    part: Integers
    linked: Integers
    stiff: NDArray[np.bool_]
    meshed: NDArray[np.bool_]


def connectivity(structure: Structure) -> Connectivity:
    """Parts and links of a structure with its selected equations; all sets of equations if none is selected."""
    grids = len(structure.nodes.ids)
    count = grids + len(structure.nodes.scalar_points)
    stiff, meshed = np.zeros(count, bool), np.zeros(count, bool)
    links: list[tuple[Integers, Integers]] = [_of_equations(rows, grids) for rows in _equations(structure)]
    links += [_of_matrix(sp.coo_array(matrix.upper), grids) for matrix in structure.assembled]
    sides: list[tuple[Integers, Integers]] = []
    for batch in structure.batches:
        points = np.where(batch.dofs >= 0, _points(batch.dofs, grids), -1)
        used = np.unique(points[points >= 0])
        stiff[used] |= batch.kind not in _MASS_KINDS
        of_mesh = batch.card in (*SHELLS, *SOLIDS)
        meshed[used] |= of_mesh
        (sides if of_mesh else links).append(_of_rows(points))
    linked = _components(links, count)
    return Connectivity(_components([*links, *sides], count), linked, stiff, meshed)


def _equations(structure: Structure) -> Iterator[ConstraintRows]:
    yield structure.rigid
    chosen = structure.default_multipoint_set
    yield from (rows for number, rows in structure.multipoint_sets.items() if chosen is None or number == chosen)


def _points(dofs: Integers, grids: int) -> Integers:
    return np.asarray(np.where(dofs < 6 * grids, dofs // 6, dofs - 5 * grids))


def _of_rows(points: Integers) -> tuple[Integers, Integers]:
    """Edges from the first point of each row to the others; −1 is no point."""
    first = points[np.arange(len(points)), (points >= 0).argmax(axis=1)]
    one, other = np.repeat(first, points.shape[1]), points.ravel()
    known = (one >= 0) & (other >= 0)
    return one[known], other[known]


def _of_equations(rows: ConstraintRows, grids: int) -> tuple[Integers, Integers]:
    return _points(rows.dependent[rows.row], grids), _points(rows.dof, grids)


def _of_matrix(upper: sp.coo_array, grids: int) -> tuple[Integers, Integers]:
    return _points(upper.row.astype(np.int64), grids), _points(upper.col.astype(np.int64), grids)


def _components(edges: Sequence[tuple[Integers, Integers]], count: int) -> Integers:
    one = np.concatenate([np.zeros(0, np.int64), *(a for a, _ in edges)])
    other = np.concatenate([np.zeros(0, np.int64), *(b for _, b in edges)])
    graph = sp.coo_array((np.ones(len(one), np.int8), (one, other)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)


def coincident_pairs(structure: Structure, found: Connectivity) -> Integers:
    """(m, 2) rows of grid points of shells and solids that are in one place without a connection between them."""
    rows = np.flatnonzero(found.meshed[: len(structure.nodes.ids)])
    if len(rows) < 2 or not structure.nodes.has_coordinates:
        return np.zeros((0, 2), np.int64)
    xyz = structure.nodes.xyz[rows]
    reach = _SAME_PLACE * float(np.linalg.norm(np.ptp(xyz, axis=0)))
    tree = cKDTree(xyz)
    if reach <= 0.0 or int(tree.count_neighbors(tree, reach)) > len(rows) + 2 * _MOST_PAIRS:
        return np.zeros((0, 2), np.int64)
    pairs = np.sort(rows[tree.query_pairs(reach, output_type="ndarray")].reshape(-1, 2), axis=1)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    return np.asarray(pairs[found.linked[pairs[:, 0]] != found.linked[pairs[:, 1]]])


def repeated_elements(batch: ElementBatch) -> Iterator[tuple[int, int, bool]]:
    """Numbers of two elements of a batch with the same grid points, and whether all their values are the same."""
    rows = np.sort(batch.nodes, axis=1)
    order = np.lexsort(rows.T)
    same = (rows[order[1:]] == rows[order[:-1]]).all(axis=1)
    for k in np.flatnonzero(same).tolist():
        one, other = sorted((int(order[k]), int(order[k + 1])))
        alike = all(at[one] == at[other] for at in batch.roles.values())
        yield int(batch.ids[one]), int(batch.ids[other]), alike


def alternating_normals(structure: Structure) -> list[tuple[int, int]]:
    """Numbers of neighbouring shells with a stiffer upper side each, whose upper sides are opposite.

    One side of a shell is the stiffer one by an offset, or by a law that couples membrane and bending (a laminate that
    is not symmetric, or MID4). Neighbours share one side; it is listed in opposite directions where their normals
    agree.
    """
    sides, numbers, liftings, normals = [], [], [], []
    for batch in structure.batches:
        if batch.card in SHELLS:
            corners = batch.nodes[:, : 3 if batch.card in _TRIANGLES else 4]
            lifting = _liftings(batch, structure)
            some = lifting.any(axis=1)
            xyz = structure.nodes.xyz[corners[some]]
            normal = np.cross(xyz[:, 2] - xyz[:, 0], xyz[:, -1] - xyz[:, 1])
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0.0)
            each = corners.shape[1]
            sides.append(np.stack([corners[some], np.roll(corners[some], -1, axis=1)], axis=2).reshape(-1, 2))
            numbers.append(np.repeat(batch.ids[some], each))
            liftings.append(np.repeat(lifting[some], each, axis=0))
            normals.append(np.repeat(normal, each, axis=0))
    if not sides:
        return []
    side, number, lifting, normal = (np.concatenate(x) for x in (sides, numbers, liftings, normals))
    key = np.sort(side, axis=1)
    order = np.lexsort(key.T)
    _, start, count = np.unique(key[order], axis=0, return_index=True, return_counts=True)
    # a side of one shell is an edge, a side of three or more is a joint
    a, b = order[start[count == 2]], order[start[count == 2] + 1]
    opposite = (side[a, 0] == side[b, 0]) & ((lifting[a] * lifting[b]).sum(axis=1) > 0.0)
    opposite &= np.abs((normal[a] * normal[b]).sum(axis=1)) > _COPLANAR
    return [(int(number[i]), int(number[j])) for i, j in zip(a[opposite], b[opposite])]


def _liftings(batch: ElementBatch, structure: Structure) -> Reals:
    """(e, 4) offset, and the entries 11, 12, 22 of coupling over those of the membrane: lengths along the normal."""
    values = structure.values.values
    out = np.zeros((len(batch), 4))
    out[:, 0] = values[batch.roles["z0"]]
    if "C11" in batch.roles:
        stiffness = np.maximum(values[batch.roles["M11"]], values[batch.roles["M22"]]) * values[batch.roles["t"]]
        coupling = np.stack([values[batch.roles[name]] for name in ("C11", "C12", "C22")], axis=1)
        lengths = coupling * values[batch.roles["t"]][:, None] ** 2
        out[:, 1:] = np.divide(lengths, stiffness[:, None], out=np.zeros_like(lengths), where=stiffness[:, None] > 0.0)
    thickness = values[batch.roles["t"]][:, None]
    out[:, 1:][np.abs(out[:, 1:]) < _COUPLING * thickness] = 0.0
    return out


_COUPLING = 1e-4
"""Coupling of membrane and bending, as a length over the thickness, below which a laminate counts as symmetric."""

_SPRINGS = ("CELAS1", "CELAS2", "CBUSH")
"""Elements whose two ends are in one place or near each other."""
_FAR_IN_EDGES = 5.0
"""Distance of the ends of a spring over the median edge of the other elements above which, if `_FAR_IN_MODEL` is
exceeded too, a wrong grid point is suspected."""
_FAR_IN_MODEL = 0.1
"""The same distance over the diagonal of the model."""
_ALONG = 0.999
"""Cosine of the angle between a spring and the line through its ends from which it is a strut, which may be long."""


def far_ends(structure: Structure) -> list[tuple[str, int, int, int, float]]:
    """Card, number, rows of both grid points and distance of springs and bushes whose ends are far apart, the farthest
    first; struts, which act along the line through their ends, are none."""
    nodes, grids = structure.nodes, len(structure.nodes.ids)
    edges = [_edges(structure, b) for b in structure.batches if b.card not in _SPRINGS and b.nodes.shape[1] > 1]
    lengths = np.concatenate([np.zeros(0), *edges])
    lengths = lengths[lengths > 0.0]
    if not len(lengths) or not nodes.has_coordinates:
        return []
    limit = max(
        _FAR_IN_EDGES * float(np.median(lengths)), _FAR_IN_MODEL * float(np.linalg.norm(np.ptp(nodes.xyz, axis=0)))
    )
    far = []
    for batch in structure.batches:
        if batch.card in _SPRINGS:
            ends = batch.nodes[:, :2]
            between = np.asarray(((ends >= 0) & (ends < grids)).all(axis=1))
            line = np.diff(nodes.xyz[np.where(between[:, None], ends, 0)], axis=1)[:, 0]
            distance = np.linalg.norm(line, axis=1)
            for i in np.flatnonzero(between & (distance > limit)).tolist():
                if not _is_strut(structure, batch, i, line[i] / distance[i]):
                    one, other = ends[i].tolist()
                    far.append((batch.card, int(batch.ids[i]), one, other, float(distance[i])))
    return sorted(far, key=lambda one: -one[4])


def _edges(structure: Structure, batch: ElementBatch) -> Reals:
    """Distances of the first two points of each element."""
    a, b = batch.nodes[:, 0], batch.nodes[:, 1]
    known = (a >= 0) & (b >= 0) & (np.maximum(a, b) < len(structure.nodes.ids))
    return np.asarray(np.linalg.norm(structure.nodes.xyz[b[known]] - structure.nodes.xyz[a[known]], axis=1))


def _is_strut(structure: Structure, batch: ElementBatch, i: int, line: Reals) -> bool:
    """Whether a spring acts along the line through its ends alone."""
    if batch.card == "CBUSH":
        others = [batch.roles[f"K{k}"][i] for k in range(2, 7) if f"K{k}" in batch.roles]
        return not structure.values.values[others].any()
    components = batch.dofs[i] % 6
    if (components > 2).any():
        return False
    frames = structure.nodes.frames[batch.nodes[i]]
    axes = [frame[:, c] for frame, c in zip(frames, components)]
    return all(abs(float(axis @ line)) > _ALONG for axis in axes)


def merged(structure: Structure, pairs: Integers) -> Structure:
    """The structure in which the two grid points of each pair (m, 2) move together.

    A pair stays as it is if its displacement frames differ, or if both of its points are supported or depend on others.
    """
    held = structure.support_sets.get(structure.default_support_set or 0, np.zeros(0, np.int64))
    taken = {int(d) // 6 for d in (*structure.permanent, *held, *structure.rigid.dependent)}
    taken |= {int(d) // 6 for rows in structure.multipoint_sets.values() for d in rows.dependent}
    moves: list[tuple[int, int]] = []
    for one, other in pairs.tolist():
        free = next(((a, b) for a, b in ((other, one), (one, other)) if a not in taken), None)
        if free is not None and np.allclose(structure.nodes.frames[one], structure.nodes.frames[other]):
            moves.append(free)
            taken.add(free[0])
    follower, leader = (6 * np.array([m[k] for m in moves], np.int64)[:, None] + np.arange(6) for k in (0, 1))
    dependent = follower.ravel()
    count = np.arange(len(dependent))
    equations = ConstraintRows(
        dependent,
        np.concatenate([count, count]),
        np.concatenate([dependent, leader.ravel()]),
        np.concatenate([np.ones(len(dependent)), -np.ones(len(dependent))]),
        np.zeros(len(dependent), np.int64),
    )
    return replace(structure, rigid=join_constraints([structure.rigid, equations]))
