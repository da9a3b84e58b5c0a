"""One uniform refinement of a mesh: every bar becomes two, every linear shell four; the rest stays as it is.

New grid points lie midway between old ones (a curved surface keeps its facets), so that what changes is the error of
the elements and not the geometry. Rods stay whole: a rod of a truss is one by meaning, and its middle would be loose.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from femtune.arrays import Integers
from femtune.fem.elements import KINDS
from femtune.fem.elements.bar import BAR
from femtune.fem.elements.shells.flat import SHELL_QUAD
from femtune.fem.structure import ElementBatch, NodeTable, Structure

Edge = tuple[int, int]


class CannotRefineError(Exception):
    """What the refinement does not know, in words."""


def refine(structure: Structure, held: Integers, off: Iterable[int] = ()) -> Structure:
    """The structure with a mesh of half the size; grid points keep their rows, new ones follow.

    Parameters
    ----------
    held : g-set DOFs that supports hold. The middle of a shell's free edge is held where both of its ends are; of an
        inner edge only in what every grid point is held in (a plane problem)
    off : numbers of the elements that are left out

    Raises
    ------
    CannotRefineError : with the reason
    """
    batches = tuple(_without(b, off) for b in structure.batches)
    batches = tuple(b for b in batches if len(b))
    _check(structure, batches)
    corners = [b for b in batches if bool(KINDS[b.kind].children)]
    edges = {edge: len(structure.nodes.ids) + k for k, edge in enumerate(_edges(corners))}
    faces = [row for b in corners if b.kind == SHELL_QUAD.key for row in b.nodes]
    first_face = len(structure.nodes.ids) + len(edges)
    nodes = _nodes(structure.nodes, list(edges), faces)
    out, next_id, at_face = [], _next_id(structure), first_face
    for b in batches:
        split = bool(KINDS[b.kind].children)
        out.append(_children(b, edges, at_face, next_id) if split else b)
        at_face += len(b) if b.kind == SHELL_QUAD.key else 0
        next_id += (len(KINDS[b.kind].children) - 1) * len(b) if split else 0
    permanent = np.union1d(structure.permanent, _held_middles(structure.nodes, corners, edges, held, nodes))
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, list(off)))
    return replace(structure, nodes=nodes, batches=tuple(out), permanent=permanent, rigid=rigid)


def _without(batch: ElementBatch, off: Iterable[int]) -> ElementBatch:
    return _rows(batch, np.flatnonzero(~np.isin(batch.ids, list(off))))


def _rows(batch: ElementBatch, at: Integers) -> ElementBatch:
    roles, facts = ({k: np.asarray(a)[at] for k, a in arrays.items()} for arrays in (batch.roles, batch.facts))
    return replace(batch, ids=batch.ids[at], nodes=batch.nodes[at], dofs=batch.dofs[at], roles=roles, facts=facts)


def _check(structure: Structure, batches: tuple[ElementBatch, ...]) -> None:
    others = sorted({b.card for b in batches if not KINDS[b.kind].refinable})
    if others:
        raise CannotRefineError(f"{', '.join(others)} cannot be refined here")
    if any(np.any(b.facts.get("uneven", False)) for b in batches):
        raise CannotRefineError("shells whose thickness varies between their corners cannot be refined here")
    if structure.assembled or len(structure.nodes.scalar_points):
        raise CannotRefineError("models with matrices or scalar points cannot be refined here")
    if not any(bool(KINDS[b.kind].children) for b in batches):
        raise CannotRefineError("the model has neither bars nor linear shells")


def _next_id(structure: Structure) -> int:
    return 1 + max([0, *(int(b.ids.max()) for b in structure.batches if len(b)), *structure.element_kinds])


def _sides(kind: str, row: Integers) -> list[Edge]:
    n = [int(i) for i in row]
    pairs = [(n[0], n[1])] if kind == BAR.key else list(zip(n, [*n[1:], n[0]]))
    return [(min(a, b), max(a, b)) for a, b in pairs]


def _edges(batches: list[ElementBatch]) -> list[Edge]:
    return list(dict.fromkeys(edge for b in batches for row in b.nodes for edge in _sides(b.kind, row)))


def _nodes(nodes: NodeTable, edges: list[Edge], faces: list[Integers]) -> NodeTable:
    middles = [nodes.xyz[list(edge)].mean(axis=0) for edge in edges] + [nodes.xyz[face].mean(axis=0) for face in faces]
    count = len(middles)
    ids = nodes.ids.max(initial=0) + 1 + np.arange(count)
    frames = [nodes.frames[edge[0]] if np.allclose(*nodes.frames[list(edge)]) else np.eye(3) for edge in edges]
    frames += [np.eye(3)] * len(faces)
    return replace(
        nodes,
        ids=np.concatenate([nodes.ids, ids]),
        xyz=np.vstack([nodes.xyz, *middles]),
        frames=np.concatenate([nodes.frames, np.array(frames).reshape(count, 3, 3)]),
    )


def _children(batch: ElementBatch, edges: dict[Edge, int], first_face: int, next_id: int) -> ElementBatch:
    """The parts of every element; the first keeps its number."""
    points = [[*map(int, row), *(edges[edge] for edge in _sides(batch.kind, row))] for row in batch.nodes]
    if batch.kind == SHELL_QUAD.key:
        points = [[*row, first_face + k] for k, row in enumerate(points)]
    parts = KINDS[batch.kind].children
    children = [_rows(batch, np.arange(len(batch))) for _ in parts]
    out = [_placed(child, np.array(points)[:, list(at)]) for child, at in zip(children, parts)]
    if batch.kind == BAR.key:
        out = _halves(*out)
    fresh = next_id + np.arange((len(parts) - 1) * len(batch)).reshape(len(parts) - 1, len(batch))
    return _joined([out[0], *(replace(child, ids=ids) for child, ids in zip(out[1:], fresh))])


def _placed(child: ElementBatch, nodes: Integers) -> ElementBatch:
    dofs = (6 * nodes[:, :, None] + np.arange(6)).reshape(len(nodes), -1)
    return replace(child, nodes=nodes, dofs=dofs)


def _halves(first: ElementBatch, second: ElementBatch) -> list[ElementBatch]:
    """Bars share the middle of their axis; releases stay at the ends that they were at."""
    facts = first.facts
    middle, pins = 0.5 * (facts["offset_a"] + facts["offset_b"]), np.asarray(facts["pins"])
    start, end = pins.copy(), pins.copy()
    start[:, 6:], end[:, :6] = False, False
    return [
        replace(first, facts={**facts, "offset_b": middle, "pins": start}),
        replace(second, facts={**facts, "offset_a": middle, "pins": end}),
    ]


def _joined(parts: list[ElementBatch]) -> ElementBatch:
    first = parts[0]
    roles = {k: np.concatenate([np.asarray(p.roles[k]) for p in parts]) for k in first.roles}
    facts = {k: np.concatenate([np.asarray(p.facts[k]) for p in parts]) for k in first.facts}
    ids, nodes, dofs = (np.concatenate([getattr(p, name) for p in parts]) for name in ("ids", "nodes", "dofs"))
    return replace(first, ids=ids, nodes=nodes, dofs=dofs, roles=roles, facts=facts)


def _held_middles(
    nodes: NodeTable, batches: list[ElementBatch], edges: dict[Edge, int], held: Integers, refined: NodeTable
) -> Integers:
    """DOFs of the new grid points that supports hold."""
    fixed = np.zeros((len(nodes.ids), 6), dtype=bool)
    fixed.reshape(-1)[held[held < fixed.size]] = True
    used = np.unique(np.concatenate([b.nodes.ravel() for b in batches]))
    plane = fixed[used].all(axis=0)
    sides = Counter(e for b in batches if b.kind != BAR.key for row in b.nodes for e in _sides(b.kind, row))
    out = np.zeros((len(refined.ids), 6), dtype=bool)
    for edge, row in edges.items():
        out[row] = fixed[list(edge)].all(axis=0) & (plane | (sides[edge] == 1))
    out[len(nodes.ids) + len(edges) :] = plane
    return np.flatnonzero(out.ravel()).astype(np.int64)
