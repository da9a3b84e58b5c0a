"""One uniform refinement of a mesh: bars become two, shells four, solids eight; all other elements stay as they are.

Points: new grid points of elements with mid-side grid points lie on their curved surfaces, those of linear solids
midway between the corners. Those of linear shells follow the smooth surface that their shared normals describe
(`shared_normals`), as the elements themselves do; a fold stays a fold. What is attached to grid points, such as
springs, masses, equations and matrices, stays at the old ones.

Supports: a new point between grid points that are all held in a direction is held in it if it lies on the edge of a
sheet of shells or on the surface of a solid, or on a line of three or more held grid points within a sheet. Otherwise
it is held only in the components in which every grid point is held (a plane problem).

Rigid elements: at the same places a new point between grid points that follow the same grid point in all components
follows it as well. Other rigid elements stay at the old points.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Flags, Integers, Reals
from femtune.fem.assembled import AssembledMatrix
from femtune.fem.constraints import follow_rows, rigid_motion
from femtune.fem.elements import KINDS
from femtune.fem.elements.kind import ElementKind, ElementPart
from femtune.fem.elements.shells.curved_surface import CurvedNodes
from femtune.fem.elements.shells.normals import shared_normals
from femtune.fem.elements.shells.placement import material_axis, mean_plane
from femtune.fem.elements.solids.shape import kept_functions
from femtune.fem.fields import FieldRef
from femtune.fem.preload import Preload
from femtune.fem.structure import ConstraintRows, ElementBatch, NodeTable, Structure, join_constraints

_SEED = 20
"""Seed of the random marks of grid points; any value serves, a fixed one makes refinements repeatable."""
_WEIGHT_UNITS = 16
"""Denominator of the weights: every new point is a mean of corners in sixteenths, as integers for exact keys."""
_ONE_SIDED_SLOPE = 0.1
"""Ratio of the slopes at the ends of a side below which the smaller one, at the edge of a sheet, is replaced.

There the shared normal is that of the only facet, and its slope is zero but for warping; on a smooth surface of
constant curvature both slopes are equal.
"""
_STRAIGHT_COSINE = np.cos(np.radians(30.0))
"""Held edges that meet at less than 30 degrees from straight are one line of support.

Sides of a circle of twelve or more elements still form a line, corners of a polygonal panel do not.
"""


class CannotRefineError(Exception):
    """The mesh holds something that cannot be refined; the message says what."""


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined structure.

    Parameters
    ----------
    structure : old grid points keep their rows and new ones follow; the first part of an element keeps its number.
        DOFs without stiffness are held, as no deck can hold the rotations of new points of solids
    prolongation : (refined g-set, g-set) displacements of the mesh as its elements interpolate them
    whole : cards of surfaces that were not divided
    """

    structure: Structure
    prolongation: sp.csr_array
    whole: tuple[str, ...]


def refine(structure: Structure, held: Integers, off: Iterable[int] = ()) -> Refined:
    """The structure with a mesh of half the size.

    Parameters
    ----------
    held : g-set DOFs that supports hold
    off : numbers of the elements that are left out

    Raises
    ------
    CannotRefineError : with the reason
    """
    out = frozenset(off)
    batches = tuple(b for b in (_without(b, out) for b in structure.batches) if len(b))
    divided = [b for b in batches if KINDS[b.kind].children]
    if not divided:
        cards = ", ".join(sorted({b.card for b in batches})) or "none"
        raise CannotRefineError(f"the model has no straight bars, shells or solids to divide ({cards})")
    mesh = _Mesh(replace(structure, batches=batches), tuple(_Divided.of(b) for b in divided))
    rigid = structure.rigid.keep(~np.isin(structure.rigid.owner, list(out)))
    bodies = _RigidBodies.of(rigid, len(structure.nodes.ids))
    points = mesh.points(_fixed(structure, held), bodies.number)
    nodes = points.nodes
    move = _Renumbered(len(structure.nodes.ids), len(nodes.ids))
    whole = tuple(sorted({b.card for b in batches if KINDS[b.kind].faces and not KINDS[b.kind].children}))
    refined = replace(
        structure,
        nodes=nodes,
        batches=(),
        rigid=join_constraints([move.rows(rigid), *_rigid_at_new_points(nodes, bodies, points.body)]),
        multipoint_sets={k: move.rows(v) for k, v in structure.multipoint_sets.items()},
        support_sets={k: move(v) for k, v in structure.support_sets.items()},
        permanent=np.union1d(move(structure.permanent), points.held),
        dof_sets={k: move(v) for k, v in structure.dof_sets.items()},
        assembled=tuple(move.matrix(a) for a in structure.assembled),
        preload=None if structure.preload is None else move.preload(structure.preload),
        hold_singular=True,
    )
    fresh, values = _next_id(structure), _Values(structure)
    parts: list[ElementBatch] = []
    for b in batches:
        if not KINDS[b.kind].children:
            parts.append(replace(b, dofs=move(b.dofs)))
            continue
        mine = mesh.of(b)
        made = list(_children(mine, structure, points.rows[id(mine)], fresh, values))
        fresh += sum(map(len, made)) - len(b)
        parts += made
    refined = replace(refined, batches=tuple(parts), values=values.table)
    return Refined(refined, points.prolongation(structure.nodes, move), whole)


def _without(batch: ElementBatch, off: frozenset[int]) -> ElementBatch:
    return _rows(batch, np.flatnonzero(~np.isin(batch.ids, list(off)))) if off else batch


def _rows(batch: ElementBatch, at: Integers) -> ElementBatch:
    roles, facts = ({k: np.asarray(a)[at] for k, a in arrays.items()} for arrays in (batch.roles, batch.facts))
    return replace(batch, ids=batch.ids[at], nodes=batch.nodes[at], dofs=batch.dofs[at], roles=roles, facts=facts)


def _fixed(structure: Structure, held: Integers) -> Flags:
    """(n, 6) True for the components that are held at each grid point."""
    fixed = np.zeros((len(structure.nodes.ids), 6), dtype=bool)
    fixed.reshape(-1)[held[held < fixed.size]] = True
    return fixed


def _next_id(structure: Structure) -> int:
    return 1 + max([0, *(int(b.ids.max()) for b in structure.batches if len(b)), *structure.element_kinds])


@dataclass(frozen=True, eq=False)
class _RigidBodies:
    """Grid points that follow one grid point each in all components.

    Parameters
    ----------
    number : (n,) 1 and up, of the body of each grid point, the one that is followed included; 0 for none
    followed, owner : row of the grid point that each body follows, and the number of its rigid element
    """

    number: Integers
    followed: Integers
    owner: Integers

    @classmethod
    def of(cls, rigid: ConstraintRows, count: int) -> _RigidBodies:
        number, followed, owners = np.zeros(count, np.int64), list[int](), list[int]()
        of_entry = rigid.owner[rigid.row]
        order = np.argsort(of_entry, kind="stable")
        for owner, first, last in _runs(of_entry[order]):
            dependent = rigid.dependent[rigid.owner == owner]
            free = np.setdiff1d(rigid.dof[order[first:last]], dependent)
            if len(free) and len(np.unique(free // 6)) == 1 and free[-1] < 6 * count:
                rows, components = np.unique(dependent // 6, return_counts=True)
                whole = rows[components == 6]
                if len(whole):
                    followed.append(int(free[0] // 6))
                    owners.append(int(owner))
                    number[[followed[-1], *whole]] = len(owners)
        return cls(number, np.array(followed, np.int64), np.array(owners, np.int64))


def _runs(ascending: Integers) -> Iterator[tuple[int, int, int]]:
    """Each value with the index of its first occurrence and the index after its last."""
    values, first = np.unique(ascending, return_index=True)
    yield from zip(values.tolist(), first.tolist(), [*first[1:].tolist(), len(ascending)])


def _rigid_at_new_points(nodes: NodeTable, bodies: _RigidBodies, body: Integers) -> Iterator[ConstraintRows]:
    """Equations of new points that follow a grid point; `body` is the number of the body of each point, 0 for none."""
    order = np.argsort(body, kind="stable")
    for number, first, last in _runs(body[order]):
        if number:
            at, on = order[first:last], int(bodies.followed[number - 1])
            motion = rigid_motion(nodes, at, np.full(len(at), on)).reshape(-1, 6)
            dependent = (6 * at[:, None] + np.arange(6)).ravel()
            follow = np.tile(6 * on + np.arange(6), (len(dependent), 1))
            yield follow_rows(dependent, follow, motion, int(bodies.owner[number - 1]))


@dataclass(frozen=True)
class _Renumbered:
    """DOFs of scalar points, which come after those of all grid points."""

    before: int
    after: int

    def __call__(self, dofs: Integers) -> Integers:
        shift = 6 * (self.after - self.before)
        return np.asarray(np.where(dofs >= 6 * self.before, dofs + shift, dofs))

    def rows(self, equations: ConstraintRows) -> ConstraintRows:
        return replace(equations, dependent=self(equations.dependent), dof=self(equations.dof))

    def matrix(self, matrix: AssembledMatrix) -> AssembledMatrix:
        entries, n = matrix.upper.tocoo(), matrix.upper.shape[0] + 6 * (self.after - self.before)
        places = (self(entries.row.astype(np.int64)), self(entries.col.astype(np.int64)))
        return replace(matrix, upper=sp.csr_array((entries.data, places), shape=(n, n)))

    def preload(self, preload: Preload) -> Preload:
        """The same loads on the old points."""
        old = preload.forces
        forces = np.zeros(len(old) + 6 * (self.after - self.before))
        forces[self(np.arange(len(old)))] = old
        return replace(preload, forces=forces)


# ----------------------------------------------------------------------------------------------------
# The points that the parts of an element use, as means of its corners.


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Points of the parts of a kind of element.

    Parameters
    ----------
    weights : (p, c) in sixteenths, of the corners
    parts : each part, with the indices of its nodes among the points
    sides : (s, 2) corners of each side, in the order of mid-side nodes
    nodes : number of nodes of the element
    """

    weights: Integers
    parts: tuple[tuple[ElementPart, Integers], ...]
    sides: Integers
    nodes: int

    @cached_property
    def on(self) -> NDArray[np.bool_]:
        """(p, n) nodes of the element on the side, face or body that a point is a mean of."""
        corners = self.weights > 0
        if self.nodes == corners.shape[1]:
            return corners
        middles = corners[:, self.sides[:, 0]] & corners[:, self.sides[:, 1]]
        return np.concatenate([corners, middles], axis=1)

    @cached_property
    def order(self) -> Integers:
        """(p,) 1 for corners, 2 for points on sides, more for those on faces and within."""
        return np.asarray((self.weights > 0).sum(axis=1))


def _sides(kind: ElementKind) -> list[tuple[int, int]]:
    """Corners of each side; none for linear solids, whose parts need no sides."""
    if kind.volume is not None:
        return list(kind.volume.edges)
    if kind.line:
        return [(0, 1)]
    if kind.surface is not None:
        return [(i, (i + 1) % kind.surface.corners) for i in range(kind.surface.corners)]
    if kind.faces:
        n = 3 if kind.faces[0][-1] < 0 else 4
        return [(i, (i + 1) % n) for i in range(n)]
    return []


def _is_curved(kind: ElementKind) -> bool:
    """Whether it has mid-side nodes."""
    return kind.surface is not None or kind.volume is not None


def _pattern(kind: ElementKind) -> _Pattern:
    corners = 1 + max(c for part in kind.children for weights in part.corners for c in weights)
    points: dict[tuple[int, ...], int] = {}
    parts = []
    for part in kind.children:
        weights = np.zeros((len(part.corners), corners), np.int64)
        for row, of in zip(weights, part.corners):
            row[list(of)] = _WEIGHT_UNITS // len(of)
        if _is_curved(kind):
            ends = np.array(_sides(KINDS[part.kind] if part.kind else kind))
            weights = np.concatenate([weights, weights[ends].sum(axis=1) // 2])
        parts.append((part, np.array([points.setdefault(tuple(map(int, w)), len(points)) for w in weights])))
    sides = np.array(_sides(kind), np.int64).reshape(-1, 2)
    return _Pattern(np.array(list(points)), tuple(parts), sides, corners + (len(sides) if _is_curved(kind) else 0))


@dataclass(frozen=True, eq=False)
class _Divided:
    """A batch whose elements are divided."""

    batch: ElementBatch
    kind: ElementKind
    pattern: _Pattern

    @classmethod
    def of(cls, batch: ElementBatch) -> _Divided:
        return cls(batch, KINDS[batch.kind], _pattern(KINDS[batch.kind]))

    @property
    def corners(self) -> Integers:
        """(e, c) rows of the corners."""
        return self.batch.nodes[:, : self.pattern.weights.shape[1]]

    @property
    def nodes(self) -> Integers:
        """(e, n) rows of the nodes, −1 for a mid-side node that is left out."""
        return self.batch.nodes[:, : self.pattern.nodes]

    def functions(self, xyz: Reals) -> Reals:
        """(e, p, n) shape functions at the points, of elements with grid points in a table (N, 3)."""
        share = self.pattern.weights / _WEIGHT_UNITS
        if not _is_curved(self.kind):
            return np.broadcast_to(share, (len(self.batch), *share.shape))
        missing = self.nodes < 0
        places = np.where(missing[:, :, None], np.nan, xyz[self.nodes])
        if self.kind.volume is not None:
            shape = self.kind.volume
            values = kept_functions(shape, places, shape.values(share @ shape.nodes[: shape.corners]))
        else:
            assert self.kind.surface is not None
            surface = self.kind.surface
            known = np.where(missing[:, :, None], 0.0, places)
            curved = CurvedNodes(surface, known, np.zeros_like(known), missing)
            values = curved.functions(share @ surface.nodes[: surface.corners])[:, :, 0]
        return np.broadcast_to(values, (len(self.batch), *values.shape[1:]))


# ----------------------------------------------------------------------------------------------------
# Points of all elements, each once.


@dataclass(frozen=True, eq=False)
class _Points:
    """Grid points of the refined mesh.

    Parameters
    ----------
    nodes : old points and new ones
    rows : by `id` of a divided batch, (e, p) rows of the points of its elements, −1 for a mid-side node left out
    held : DOFs of the new points that supports hold
    body : (n,) number of the rigid body that each new point belongs to; 0 for none and for old points
    shares : new points from old ones, csr (new, old)
    """

    nodes: NodeTable
    rows: dict[int, Integers]
    held: Integers
    body: Integers
    shares: sp.csr_array

    def prolongation(self, old: NodeTable, move: _Renumbered) -> sp.csr_array:
        """(refined g-set, g-set), in the displacement frames of both."""
        n, total = len(old.ids), self.nodes.n_dofs
        shares = self.shares.tocoo()
        turn = np.swapaxes(self.nodes.frames[n + shares.row], 1, 2) @ old.frames[shares.col]
        blocks = shares.data[:, None, None] * turn
        i, j = np.meshgrid(np.arange(3), np.arange(3), indexing="ij")
        parts = [(move(np.arange(old.n_dofs)), np.arange(old.n_dofs), np.ones(old.n_dofs))]
        for half in (0, 3):
            row, col = 6 * (n + shares.row)[:, None, None] + i + half, 6 * shares.col[:, None, None] + j + half
            parts.append((row.ravel(), col.ravel(), blocks.ravel()))
        rows, cols, data = (np.concatenate(a) for a in zip(*parts))
        return sp.csr_array((data, (rows, cols)), shape=(total, old.n_dofs))


@dataclass(frozen=True, eq=False)
class _Mesh:
    """A structure without the elements that are off, and its divided batches."""

    structure: Structure
    divided: tuple[_Divided, ...]

    def of(self, batch: ElementBatch) -> _Divided:
        return next(d for d in self.divided if d.batch is batch)

    @cached_property
    def _marks(self) -> NDArray[np.uint64]:
        """A random number for each grid point; weighted sums over corners identify the new points."""
        n = len(self.structure.nodes.ids)
        return np.random.default_rng(_SEED).integers(0, 2**63, n, dtype=np.uint64)

    def _keys(self, d: _Divided) -> NDArray[np.uint64]:
        """(e, p) keys of the points, equal for the same point of different elements."""
        # sums modulo 2^64
        return np.asarray(self._marks[d.corners] @ d.pattern.weights.T.astype(np.uint64))

    def _known(self) -> tuple[NDArray[np.uint64], Integers]:
        """Keys of the old grid points, ascending, and their rows."""
        n = len(self.structure.nodes.ids)
        keys, rows = [self._marks * np.uint64(_WEIGHT_UNITS)], [np.arange(n)]
        for d in self.divided:
            if _is_curved(d.kind):
                middles, ends = d.nodes[:, d.corners.shape[1] :], d.corners[:, d.pattern.sides]
                middle_keys = self._marks[ends].sum(axis=2, dtype=np.uint64) * np.uint64(_WEIGHT_UNITS // 2)
                keys.append(middle_keys[middles >= 0])
                rows.append(middles[middles >= 0])
        known, first = np.unique(np.concatenate(keys), return_index=True)
        return known, np.concatenate(rows)[first]

    def points(self, fixed: Flags, body: Integers) -> _Points:
        """All points.

        Parameters
        ----------
        fixed : (n, 6) True for the components that supports hold at the old points
        body : (n,) number of the rigid body of each old point, 0 for none
        """
        old = self.structure.nodes
        known, known_rows = self._known()
        keys = [self._keys(d) for d in self.divided]
        needed = [_needed(d) for d in self.divided]
        flat = np.concatenate([k[use] for k, use in zip(keys, needed)])
        new = np.setdiff1d(flat, known)
        every = np.concatenate([known, new])
        order = np.argsort(every)
        at = np.concatenate([known_rows, len(old.ids) + np.arange(len(new))])[order]
        rows = {}
        for d, own_keys, use in zip(self.divided, keys, needed):
            place = np.minimum(np.searchsorted(every[order], own_keys), len(order) - 1)
            rows[id(d)] = np.where(use, at[place], -1)
        shares = self._shares(rows, len(new))
        xyz = self._places(rows, shares)
        frames = _mean_frames(old.frames, shares)
        first = 1 + max(old.ids.max(initial=0), old.scalar_points.max(initial=0))
        nodes = replace(
            old,
            ids=np.concatenate([old.ids, first + np.arange(len(new))]),
            xyz=np.vstack([old.xyz, xyz]),
            frames=np.concatenate([old.frames, frames]),
        )
        held = self._held(rows, fixed, len(nodes.ids))
        following = self._following(rows, body, len(nodes.ids))
        following[held // 6] = 0
        return _Points(nodes, rows, held, following, shares)

    def _shares(self, rows: dict[int, Integers], count: int) -> sp.csr_array:
        """New points from the nodes of one element each, a curved one if there is one."""
        n = len(self.structure.nodes.ids)
        owner = np.full(count, -1)
        parts = []
        for d in sorted(self.divided, key=lambda d: not _is_curved(d.kind)):
            target_rows = rows[id(d)] - n
            e, p = np.nonzero(target_rows >= 0)
            target = target_rows[e, p]
            fresh = owner[target] < 0
            e, p, target = e[fresh], p[fresh], target[fresh]
            target, first = np.unique(target, return_index=True)
            e, p = e[first], p[first]
            owner[target] = 0
            functions, nodes = d.functions(self.structure.nodes.xyz)[e, p], d.nodes[e]
            functions = np.where(nodes >= 0, functions, 0.0)
            parts.append((np.repeat(target, nodes.shape[1]), np.maximum(nodes, 0).ravel(), functions.ravel()))
        row, col, data = (np.concatenate(a) for a in zip(*parts))
        out = sp.csr_array((data, (row, col)), shape=(count, n))
        out.eliminate_zeros()
        return out

    def _places(self, rows: dict[int, Integers], shares: sp.csr_array) -> Reals:
        """(new, 3) positions of the new points: interpolated, or on the smooth surface of flat shells."""
        old = self.structure.nodes
        xyz = np.asarray(shares @ old.xyz)
        lift = np.zeros_like(xyz)
        on_edge = self._at_sheet_edges()
        for d in self.divided:
            if d.kind.shell and not _is_curved(d.kind):
                new_rows, height = rows[id(d)] - len(old.ids), _lifted(d, self.structure, on_edge)
                for p in range(new_rows.shape[1]):
                    at, by = new_rows[new_rows[:, p] >= 0, p], height[new_rows[:, p] >= 0, p]
                    larger = np.linalg.norm(by, axis=1) > np.linalg.norm(lift[at], axis=1)
                    lift[at[larger]] = by[larger]
        return xyz + lift

    @cached_property
    def _shells(self) -> list[_Divided]:
        return [d for d in self.divided if d.kind.shell]

    def _side_keys(self, d: _Divided) -> NDArray[np.uint64]:
        """(e, s) keys of the middles of all sides."""
        return np.asarray(self._marks[d.corners[:, d.pattern.sides]].sum(axis=2, dtype=np.uint64))

    @cached_property
    def _free_sides(self) -> NDArray[np.uint64]:
        """Keys of the sides that only one shell has."""
        keys = [self._side_keys(d).ravel() for d in self._shells]
        sides, count = np.unique(np.concatenate([np.zeros(0, np.uint64), *keys]), return_counts=True)
        return sides[count == 1]

    def _at_sheet_edges(self) -> Flags:
        """(n,) True for grid points on the edge of a sheet of shells."""
        out = np.zeros(len(self.structure.nodes.ids), bool)
        for d in self._shells:
            free = np.isin(self._side_keys(d), self._free_sides)
            out[d.corners[:, d.pattern.sides][free].ravel()] = True
        return out

    @cached_property
    def _free_faces(self) -> NDArray[np.uint64]:
        """Keys of the faces that only one solid has, each the sum of the corners' marks."""
        faces, count = np.unique(
            np.concatenate([np.zeros(0, np.uint64), *(f.ravel() for d in self.divided for f in self._faces(d))]),
            return_counts=True,
        )
        return faces[count == 1]

    def _faces(self, d: _Divided) -> Iterator[NDArray[np.uint64]]:
        """(e,) keys of each face of a batch of solids."""
        for face in d.kind.sides:
            yield self._marks[d.corners[:, [c for c in face if c >= 0]]].sum(axis=1, dtype=np.uint64)

    def _held(self, rows: dict[int, Integers], fixed: Flags, count: int) -> Integers:
        """DOFs of the new points that are held."""
        old, out = len(self.structure.nodes.ids), np.zeros((count, 6), bool)
        used = np.unique(np.concatenate([d.corners.ravel() for d in self.divided]))
        plane = fixed[used].all(axis=0)
        out[old:] = plane
        for d in self.divided:
            outside = self._outside(d)
            if outside is None:
                continue
            fixed_nodes = fixed[np.maximum(d.nodes, 0)] | (d.nodes < 0)[:, :, None]
            # (e, p, 6): all nodes of the side or face that the point lies on
            all_held = ~np.einsum("pn,enk->epk", d.pattern.on, ~fixed_nodes)
            good = all_held & outside[:, :, None] if outside.ndim == 2 else all_held & outside
            at = rows[id(d)]
            e, p = np.nonzero(at >= old)
            np.logical_or.at(out, at[e, p], good[e, p])
        out |= self._held_lines(rows, fixed, count)
        return np.flatnonzero(out.ravel()).astype(np.int64)

    def _outside(self, d: _Divided) -> Flags | None:
        """(e, p) points on the edge of a sheet, or on the surface of a solid; None for bars."""
        if d.kind.line:
            return None
        on, order = d.pattern.weights > 0, d.pattern.order
        out = np.zeros((len(d.batch), len(on)), bool)
        if d.kind.shell:
            free = np.isin(self._side_keys(d), self._free_sides)
            for s, ends in enumerate(d.pattern.sides):
                out[:, (order == 2) & on[:, ends].all(axis=1)] |= free[:, s, None]
            return out
        for face, keys in zip(d.kind.sides, self._faces(d)):
            corners = [c for c in face if c >= 0]
            inside = on[:, corners].sum(axis=1) == order
            out[:, inside] |= np.isin(keys, self._free_faces)[:, None]
        return out

    def _following(self, rows: dict[int, Integers], body: Integers, count: int) -> Integers:
        """(count,) number of the rigid body that a new point belongs to, 0 for none."""
        old, out = len(self.structure.nodes.ids), np.zeros(count, np.int64)
        if not body.any():
            return out
        for d in self.divided:
            outside = self._outside(d)
            if outside is None:
                continue
            number = np.where(d.nodes >= 0, body[np.maximum(d.nodes, 0)], 0)
            some = np.flatnonzero((number > 0).sum(axis=1) > 1)
            present = (d.nodes[some] >= 0)[:, None, :] & d.pattern.on[None]
            bodies = np.broadcast_to(number[some][:, None, :], present.shape)
            least = np.where(present, bodies, len(body)).min(axis=2)
            good = (least > 0) & (least == np.where(present, bodies, 0).max(axis=2)) & outside[some]
            at = rows[id(d)][some]
            e, p = np.nonzero(good & (at >= old))
            out[at[e, p]] = least[e, p]
        pair, at = self._inner_sides(rows, old)
        both = (body[pair[:, 0]] > 0) & (body[pair[:, 0]] == body[pair[:, 1]])
        lines = _in_line(pair[both], self.structure.nodes.xyz)
        out[at[both][lines]] = body[pair[both][lines, 0]]
        return out

    def _held_lines(self, rows: dict[int, Integers], fixed: Flags, count: int) -> Flags:
        """(n, 6) new points on inner sides of shells that belong to a line of at least two sides with held ends."""
        out = np.zeros((count, 6), bool)
        pair, at = self._inner_sides(rows, len(fixed))
        for k in range(6):
            both = fixed[pair, k].all(axis=1)
            lines = _in_line(pair[both], self.structure.nodes.xyz)
            out[at[both][lines], k] = True
        return out

    def _inner_sides(self, rows: dict[int, Integers], old: int) -> tuple[Integers, Integers]:
        """(s, 2) ends of the sides that several shells have, in ascending order, and (s,) their middles, if new."""
        ends, middles, outer = [np.zeros((0, 2), np.int64)], [np.zeros(0, np.int64)], [np.zeros(0, bool)]
        for d in self._shells:
            sides = d.corners[:, d.pattern.sides]
            order = (d.pattern.order == 2)[None] & (
                d.pattern.weights[:, d.pattern.sides].sum(axis=2) == _WEIGHT_UNITS
            ).T
            for s in range(len(d.pattern.sides)):
                for p in np.flatnonzero(order[s]):
                    ends.append(sides[:, s])
                    middles.append(rows[id(d)][:, p])
                    outer.append(np.isin(self._side_keys(d)[:, s], self._free_sides))
        pair, at, free = np.concatenate(ends), np.concatenate(middles), np.concatenate(outer)
        inner = (at >= old) & ~free
        return np.sort(pair[inner], axis=1), at[inner]


def _in_line(pair: Integers, xyz: Reals) -> Flags:
    """(m,) sides (m, 2) that another one continues nearly straight at one of its ends."""
    sides, where = np.unique(pair, axis=0, return_inverse=True)
    if not len(sides):
        return np.zeros(len(pair), bool)
    along = xyz[sides[:, 1]] - xyz[sides[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    # every end of a side, with the direction of the side away from it
    point, out = sides.T.ravel(), np.concatenate([along, -along])
    side = np.tile(np.arange(len(sides)), 2)
    order = np.argsort(point, kind="stable")
    point, out, side = point[order], out[order], side[order]
    good = np.zeros(len(sides), bool)
    starts = np.flatnonzero(np.diff(point, prepend=-1))
    for a, b in zip(starts, [*starts[1:], len(point)]):
        if b - a > 1:
            meets = (out[a:b] @ out[a:b].T <= -_STRAIGHT_COSINE).any(axis=1)
            good[side[a:b][meets]] = True
    return good[where.ravel()]


def _needed(d: _Divided) -> Flags:
    """(e, p) False for middles of halves of a side without a mid-side node: neighbours are linear there."""
    use = np.ones((len(d.batch), len(d.pattern.weights)), bool)
    if not _is_curved(d.kind):
        return use
    missing = d.nodes[:, d.corners.shape[1] :] < 0
    quarter = (d.pattern.weights == _WEIGHT_UNITS // 4).any(axis=1) & (d.pattern.order == 2)
    for s, ends in enumerate(d.pattern.sides):
        on = quarter & (d.pattern.weights[:, ends] > 0).all(axis=1)
        use[np.ix_(missing[:, s], on)] = False
    return use


def _mean_frames(frames: Reals, shares: sp.csr_array) -> Reals:
    """(m, 3, 3) rotations nearest to the means of the old points' frames."""
    mean = np.asarray(shares @ frames.reshape(len(frames), 9)).reshape(-1, 3, 3)
    same = np.isclose(mean, np.eye(3), atol=1e-12).all(axis=(1, 2))
    left, size, right = np.linalg.svd(mean[~same])
    turned = left @ right
    # frames of very different directions have no mean
    turned[(size.min(axis=1) < 0.1) | (np.linalg.det(turned) < 0.0)] = np.eye(3)
    out = np.tile(np.eye(3), (len(mean), 1, 1))
    out[~same] = turned
    return out


def _lifted(d: _Divided, structure: Structure, on_edge: Flags) -> Reals:
    """(e, p, 3) from the flat points of shells to the surface through their corners with the shared normals.

    A side is the cubic normal to both shared normals; the middle of a quadrilateral lies on the Coons surface.
    """
    xyz, normals = structure.nodes.xyz[d.corners], shared_normals(d.batch, structure)
    at_edge = on_edge[d.corners]
    out = np.zeros((len(d.batch), len(d.pattern.weights), 3))
    middle = np.zeros((len(d.batch), 3))
    for i, j in d.pattern.sides:
        side = xyz[:, j] - xyz[:, i]
        down = [np.einsum("ea,ea->e", side, normals[:, k]) for k in (i, j)]
        slope = np.stack([-down[0], down[1]], axis=1)
        for k, other in ((0, 1), (1, 0)):
            one_sided = at_edge[:, (i, j)[k]] & (np.abs(slope[:, k]) < _ONE_SIDED_SLOPE * np.abs(slope[:, other]))
            slope[one_sided, k] = slope[one_sided, other]
        mean = normals[:, i] + normals[:, j]
        mean /= np.maximum(np.linalg.norm(mean, axis=1), 1e-9)[:, None]
        lift = mean * (slope.sum(axis=1) / 8.0)[:, None]
        here = (d.pattern.weights[:, [i, j]] > 0).all(axis=1) & (d.pattern.order == 2)
        out[:, here] = lift[:, None]
        middle += 0.5 * lift
    if xyz.shape[1] == 4:
        out[:, d.pattern.order == 4] = middle[:, None]
    return out


# ----------------------------------------------------------------------------------------------------
# Parts of elements as batches.


class _Values:
    """The table of values, and the additional values that the parts need, such as thicknesses at new corners."""

    def __init__(self, structure: Structure) -> None:
        self.table = structure.values

    def add(self, refs: list[FieldRef], values: Reals) -> Integers:
        """(m,) positions of the added values."""
        first = len(self.table.refs)
        self.table = replace(
            self.table, refs=(*self.table.refs, *refs), values=np.concatenate([self.table.values, values])
        )
        return first + np.arange(len(refs))


def _children(
    d: _Divided, structure: Structure, points: Integers, next_id: int, values: _Values
) -> Iterator[ElementBatch]:
    """The parts of every element; the first keeps its number."""
    batch = _by_direction(d.batch, structure) if d.kind.shell and d.kind.surface is None else d.batch
    groups: dict[str, list[ElementBatch]] = {}
    for k, (part, at) in enumerate(d.pattern.parts):
        child = _placed(batch, points[:, at], part.kind or d.batch.kind)
        if d.kind.end_offsets:
            child = _half(child, k)
            if "stations" in child.facts:
                child = _own_stations(child, k, values)
        elif "uneven" in child.facts:
            child = _own_thickness(child, d.pattern.weights[at[: len(part.corners)]] / _WEIGHT_UNITS, values)
        if k:
            child = replace(child, ids=next_id + (k - 1) * len(batch) + np.arange(len(batch)))
        groups.setdefault(child.kind, []).append(child)
    yield from (_joined(parts) for parts in groups.values())


def _by_direction(batch: ElementBatch, structure: Structure) -> ElementBatch:
    """Material axes as directions, since the first sides of the parts are not parallel to that of the element."""
    axes = mean_plane(structure.nodes.xyz[batch.nodes])[0]
    cosine = material_axis(axes, batch.facts["theta"], batch.facts["direction"])
    return replace(batch, facts={**batch.facts, "direction": np.einsum("mij,mj->mi", axes[:, :, :2], cosine)})


def _placed(batch: ElementBatch, nodes: Integers, kind: str) -> ElementBatch:
    each = batch.dofs.shape[1] // batch.nodes.shape[1]
    at = 6 * nodes[:, :, None] + np.arange(each)
    dofs = np.where(nodes[:, :, None] >= 0, at, -1).reshape(len(nodes), -1)
    return replace(batch, kind=kind, nodes=nodes, dofs=dofs)


def _half(bar: ElementBatch, k: int) -> ElementBatch:
    """Half of a bar; both halves share the middle of the axis, and releases stay at the original ends."""
    facts, pins = bar.facts, np.array(bar.facts["pins"])
    middle = 0.5 * (facts["offset_a"] + facts["offset_b"])
    pins[:, 6 if k == 0 else 0 : 12 if k == 0 else 6] = False
    return replace(bar, facts={**facts, ("offset_b", "offset_a")[k]: middle, "pins": pins})


def _own_stations(beam: ElementBatch, k: int, values: _Values) -> ElementBatch:
    """Stations of a half; properties are linear between stations, so that additional ones change nothing."""
    stations = np.array(beam.facts["stations"], float)
    count, roles, halves = stations.shape[1], dict(beam.roles), np.empty_like(stations)
    names = sorted({name.partition("@")[0] for name in roles if "@" in name})
    for uncut in np.unique(stations, axis=0):
        at, inside = np.flatnonzero((stations == uncut).all(axis=1)), uncut[(uncut > 0.5 * k) & (uncut < 0.5 * (k + 1))]
        places = np.array([0.5 * k, *inside, 0.5 * (k + 1)])
        while len(places) < count:
            widest = int(np.diff(places).argmax())
            places = np.insert(places, widest + 1, places[widest : widest + 2].mean())
        halves[at] = 2.0 * places - k
        share = np.array([np.interp(places, uncut, hat) for hat in np.eye(count)]).T
        for name in names:
            known = values.table.values[np.stack([beam.roles[f"{name}@{j}"][at] for j in range(count)], axis=1)]
            first = len(values.table.refs)
            refs = [FieldRef(beam.card, 0, f"station {first + i}") for i in range(known.size)]
            fresh = values.add(refs, (known @ share.T).ravel()).reshape(known.shape)
            for j in range(count):
                roles[f"{name}@{j}"] = _put(roles[f"{name}@{j}"], at, fresh[:, j])
    return replace(beam, roles=roles, facts={**beam.facts, "stations": halves})


def _put(column: Integers, at: Integers, values: Integers) -> Integers:
    out = np.array(column)
    out[at] = values
    return out


def _own_thickness(child: ElementBatch, share: Reals, values: _Values) -> ElementBatch:
    """Thickness at the corners of a part, where it varies."""
    uneven = np.flatnonzero(child.facts["uneven"])
    names = [f"t{i + 1}" for i in range(share.shape[1])]
    at = np.stack([child.roles[name] for name in names], axis=1)
    thick = values.table.values[at[uneven]] @ share.T
    first = len(values.table.refs)
    refs = [FieldRef(child.card, 0, f"thickness {first + i}") for i in range(thick.size)]
    at = at.copy()
    at[uneven] = values.add(refs, thick.ravel()).reshape(thick.shape)
    return replace(child, roles={**child.roles, **{name: at[:, i] for i, name in enumerate(names)}})


def _joined(parts: list[ElementBatch]) -> ElementBatch:
    first = parts[0]
    roles = {k: np.concatenate([np.asarray(p.roles[k]) for p in parts]) for k in first.roles}
    facts = {k: np.concatenate([np.asarray(p.facts[k]) for p in parts]) for k in first.facts}
    return replace(
        first,
        ids=np.concatenate([p.ids for p in parts]),
        nodes=np.concatenate([p.nodes for p in parts]),
        dofs=np.concatenate([p.dofs for p in parts]),
        roles=roles,
        facts=facts,
    )
