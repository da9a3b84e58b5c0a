"""DOFs without stiffness, or without stiffness and mass, sought node by node as by Nastran's AUTOSPC."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Integers, Reals
from femtune.fem.elimination import Elimination
from femtune.fem.structure import NodeTable, Structure

SINGULAR_RATIO = 1e-8
"""Principal stiffness of a node, relative to the largest entry of its 3 × 3 block, up to which it is singular.

The default of Nastran's PARAM EPZERO, so that the same DOFs are held.
"""
_OUTSTANDING = 1e4
"""Ratio of the largest entry of a block to the median one above which the block stands out.

Meshes of one structure vary by two to three decades (element sizes, thicknesses); rigid springs of 1e6 and more stand
out. The limit `SINGULAR_RATIO` then refers to this multiple of the median.
"""
_ROUNDING = 64 * np.finfo(float).eps
"""Relative rounding error of an assembled entry: that of some dozens of elements that meet at a node."""


def singular_dofs(stiffness: sp.csr_array, free: Integers, nodes: NodeTable) -> Integers:
    """g-set DOFs to hold: those nearest to the directions in which a node's diagonal block has no stiffness.

    A direction has none if its principal stiffness is at most `SINGULAR_RATIO` times the block's largest entry. If that
    entry stands out among the nodes, a usual one takes its place: beside one very stiff spring the other directions are
    soft, not singular. A mechanism of several nodes is not found here.

    Parameters
    ----------
    stiffness : (n, n) symmetric, on the free DOFs
    free : (n,) g-set DOFs of its rows
    nodes : to tell a node's translations and rotations
    """
    blocks, present = _blocks(stiffness, free, 6 * len(nodes.ids))
    largest = _largest(blocks)
    at_grids = _without(blocks, present, np.maximum(SINGULAR_RATIO * _measure(largest), _ROUNDING * largest))
    scalar = (free >= 6 * len(nodes.ids)) & (stiffness.diagonal() == 0.0)
    return np.union1d(at_grids, free[scalar]).astype(np.int64)


def empty_dofs(stiffness: sp.csr_array, mass: sp.csr_array, free: Integers, nodes: NodeTable) -> Integers:
    """g-set DOFs to hold: those nearest to the directions in which a node's blocks have neither stiffness nor mass.

    Each matrix is zero there except for rounding of its entries at the node. Parameters are those of `singular_dofs`.
    """
    n_grid = 6 * len(nodes.ids)
    (of_stiffness, present), (of_mass, _) = (_blocks(matrix, free, n_grid) for matrix in (stiffness, mass))
    # both scaled to about 1, so that neither hides the other, and without signs, so that they do not cancel
    both = _magnitude(of_stiffness) + _magnitude(of_mass)
    at_grids = _without(both, present, _ROUNDING * _largest(both))
    scalar = (free >= n_grid) & (stiffness.diagonal() == 0.0) & (mass.diagonal() == 0.0)
    return np.union1d(at_grids, free[scalar]).astype(np.int64)


def _magnitude(blocks: Reals) -> Reals:
    """(b, 3, 3) with the absolute eigenvalues of the blocks, relative to the largest entry of each."""
    largest = _largest(blocks)
    values, vectors = np.linalg.eigh(blocks / np.where(largest > 0.0, largest, 1.0)[:, None, None])
    return np.asarray((vectors * np.abs(values)[:, None, :]) @ vectors.transpose(0, 2, 1))


def _largest(blocks: Reals) -> Reals:
    return np.asarray(np.abs(blocks).max(axis=(1, 2), initial=0.0))


def _without(blocks: Reals, present: NDArray[np.bool_], limits: Reals) -> Integers:
    """DOFs of grid points nearest to the principal directions of blocks (b, 3, 3) with values up to limits (b,)."""
    largest = _largest(blocks)
    empty = present & (largest == 0.0)[:, None]
    dofs = [np.flatnonzero(empty.ravel())]
    checked = np.flatnonzero(largest > 0.0)
    padded = blocks[checked] + np.eye(3) * (~present[checked] * largest[checked, None])[:, None, :]
    values, vectors = np.linalg.eigh(padded)
    # negative stiffness is an error that the eigen-solution reports; such a DOF must not be held
    null = np.abs(values) <= limits[checked, None]
    one = null.sum(axis=1) == 1
    # the usual case: flat plates have one singular direction at every grid point
    only = np.take_along_axis(vectors[one], np.argmax(null[one], axis=1)[:, None, None], axis=2)[:, :, 0]
    dofs.append(3 * checked[one] + np.argmax(np.abs(only), axis=1))
    for k in np.flatnonzero(null.any(axis=1) & ~one):
        dofs.append(3 * checked[k] + _nearest(vectors[k][:, null[k]]))
    return np.concatenate(dofs)


def _measure(largest: Reals) -> Reals:
    """(b,) largest entries of the blocks, limited where they stand out among translations or among rotations."""
    out = largest.copy()
    for kind in (out[0::2], out[1::2]):
        stiff = kind[kind > 0.0]
        if stiff.size:
            np.minimum(kind, _OUTSTANDING * np.quantile(stiff, 0.5, method="lower"), out=kind)
    return out


def _blocks(stiffness: sp.csr_array, free: Integers, n_grid: int) -> tuple[Reals, NDArray[np.bool_]]:
    """Diagonal 3 × 3 blocks of all grid points' translations and rotations, and which of their DOFs are free."""
    entries = stiffness.tocoo()
    row, col = free[entries.row], free[entries.col]
    diagonal = (row // 3 == col // 3) & (row < n_grid)
    blocks = np.zeros((n_grid // 3, 3, 3))
    np.add.at(blocks, (row[diagonal] // 3, row[diagonal] % 3, col[diagonal] % 3), entries.data[diagonal])
    present = np.zeros(n_grid, bool)
    present[free[free < n_grid]] = True
    return blocks, present.reshape(-1, 3)


def _nearest(null: Reals) -> Integers:
    """The components in which the null directions (3, k) are largest, k of them."""
    *_, pivots = scipy.linalg.qr(null.T, pivoting=True)
    return np.asarray(pivots[: null.shape[1]], dtype=np.int64)


# ----------------------------------------------------------------------------------------------------
# Straight lines of bars that can rotate about their axis: a mechanism of several nodes.


_LINE_TOLERANCE = 1e-9
"""Largest distance of points from a line, relative to its length, and largest error of the constrained rotation.

Rounding of coordinates after transformations is 1e-15; a line that is bent by more resists the rotation.
"""


@dataclass(frozen=True, eq=False)
class Spin:
    """A rotation of a straight part of the model about its line.

    Parameters
    ----------
    motion : (n,) on the free DOFs, unit angle
    dof : g-set DOF that stops it, the rotation with the largest share
    """

    motion: Reals
    dof: int


def spinning_lines(structure: Structure, elimination: Elimination, off: Collection[int] = ()) -> list[Spin]:
    """Parts of the model whose grid points lie on one line and whose constraints permit rotation about it.

    Whether stiffness or mass resists the rotation is not examined.

    Parameters
    ----------
    structure : the model
    elimination : its free DOFs
    off : numbers of elements that are absent
    """
    label = _parts(structure, list(off))
    count = np.bincount(label[label >= 0])
    return [
        spin
        for part in np.flatnonzero(count > 1)
        if (spin := _spin(structure, elimination, np.flatnonzero(label == part))) is not None
    ]


def _parts(structure: Structure, off: list[int]) -> Integers:
    """(n,) number of the connected part of each grid point; −1 if the part has an element of more than two nodes."""
    n = len(structure.nodes.ids)
    pairs, solid = [np.zeros((0, 2), np.int64)], np.zeros(n, bool)
    for batch in structure.batches:
        nodes = batch.nodes[~np.isin(batch.ids, off)] if off else batch.nodes
        if nodes.shape[1] > 2:
            solid[nodes[nodes >= 0]] = True
        elif nodes.shape[1] == 2:
            pairs.append(nodes[(nodes >= 0).all(axis=1)])
    rows = structure.rigid
    points = rows.dof // 6
    same = (rows.row[1:] == rows.row[:-1]) & (points[1:] < n) & (points[:-1] < n)
    pairs.append(np.stack([points[:-1][same], points[1:][same]], axis=1))
    edges = np.concatenate(pairs)
    graph = sp.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, label = sp.csgraph.connected_components(graph, directed=False)
    return np.where(np.isin(label, np.unique(label[solid])), -1, label)


def _spin(structure: Structure, elimination: Elimination, points: Integers) -> Spin | None:
    nodes = structure.nodes
    relative = nodes.xyz[points] - nodes.xyz[points[0]]
    far = relative[np.argmax(np.linalg.norm(relative, axis=1))]
    size = float(np.linalg.norm(far))
    if size == 0.0:
        return None
    axis = far / size
    if np.linalg.norm(relative - np.outer(relative @ axis, axis), axis=1).max() > _LINE_TOLERANCE * size:
        return None
    motion = np.zeros(nodes.n_dofs)
    turn = np.einsum("nji,j->ni", nodes.frames[points], axis)
    motion[6 * points[:, None] + np.arange(3, 6)] = turn
    free = motion[elimination.free]
    if not free.any() or np.abs(elimination.T @ free - motion).max() > _LINE_TOLERANCE:
        return None
    return Spin(free, int(elimination.free[np.argmax(np.abs(free))]))
