"""Parts of a mesh: a property that is wrong in one place only is found where it is tested by parts.

A set of elements is divided into its connected pieces if these are few, otherwise into halves across the direction in
which it extends most; each part is divided once more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from femtune.arrays import Integers, Reals
from femtune.fem import Structure

_FEWEST_DIVIDED = 4
"""Elements below which a set is not divided: the parts would be single elements or pairs."""
_MOST_PIECES = 4
"""Connected pieces above which a set is halved instead: a bolt pattern is not one field a bolt."""
_ROUND = 9
"""Digits of a position that decide on which side of the middle an element lies."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Elements with their grid points and centres.

    Parameters
    ----------
    nodes : (n, k) positions of the grid points of each element, −1 where it has fewer
    corners : (n, 4, 3) of a drawing: the first four grid points, the last one repeated where an element has fewer
    centres : (n, 3)
    row : position of an element in both, by its number; elements on scalar points alone are not among them
    """

    nodes: Integers
    corners: Reals
    centres: Reals
    row: Mapping[int, int]

    def divided(self, elements: frozenset[int], depth: int) -> Iterator[frozenset[int]]:
        """The parts of a set of elements, and their parts, down to a depth; none where it is too small.

        Examples
        --------
        >>> line = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
        >>> ends = np.zeros((4, 4, 3))
        >>> ends[:, :, 0] = line[:, [0, 1, 1, 1]]
        >>> mesh = Mesh(line, ends, ends[:, :2].mean(axis=1), {1: 0, 2: 1, 3: 2, 4: 3})
        >>> [sorted(part) for part in mesh.divided(frozenset({1, 2, 3, 4}), 2)]
        [[1, 2], [3, 4]]
        """
        if depth < 1 or len(elements) < _FEWEST_DIVIDED or not elements <= self.row.keys():
            return
        if elements not in self._known:
            self._known[elements] = self._parts(sorted(elements))
        for part in self._known[elements]:
            yield part
            yield from self.divided(part, depth - 1)

    @cached_property
    def _known(self) -> dict[frozenset[int], list[frozenset[int]]]:
        """Parts of sets that were divided already: fields of one property have the same elements."""
        return {}

    def _parts(self, elements: list[int]) -> list[frozenset[int]]:
        rows = np.array([self.row[e] for e in elements])
        pieces = self._pieces(rows)
        count = int(pieces.max()) + 1
        side = pieces if 1 < count <= _MOST_PIECES else _sides(self.centres[rows])
        return [frozenset(elements[i] for i in np.flatnonzero(side == k)) for k in range(int(side.max()) + 1)]

    def _pieces(self, rows: Integers) -> Integers:
        """Number of the connected piece of each element: those of one piece share grid points."""
        nodes = self.nodes[rows]
        at, own = np.nonzero(nodes >= 0)
        uses = sp.csr_array((np.ones(len(at)), (at, nodes[at, own])), shape=(len(rows), int(self.nodes.max()) + 1))
        return np.asarray(connected_components(uses @ uses.T, directed=False)[1])


def _sides(centres: Reals) -> Integers:
    """0 or 1 for each element, on either side of the middle of the direction in which they extend most."""
    away = centres - centres.mean(axis=0)
    direction = np.linalg.svd(away, full_matrices=False)[2][0]
    # the sign of a singular vector is arbitrary
    direction = direction * np.sign(direction[np.argmax(np.abs(direction))])
    along = np.round(away @ direction / (np.abs(away).max(initial=0.0) or 1.0), _ROUND)
    side = np.zeros(len(centres), np.int64)
    side[np.argsort(along, kind="stable")[len(along) // 2 :]] = 1
    return side


def mesh_of(structure: Structure) -> Mesh:
    """The elements of a structure that have grid points."""
    n = len(structure.nodes.ids)
    width = max((b.nodes.shape[1] for b in structure.batches), default=1)
    nodes, numbers = [np.zeros((0, width), np.int64)], [np.zeros(0, np.int64)]
    for batch in structure.batches:
        grid_rows = np.where((batch.nodes >= 0) & (batch.nodes < n), batch.nodes, -1)
        some = (grid_rows >= 0).any(axis=1)
        nodes.append(np.pad(grid_rows[some], ((0, 0), (0, width - grid_rows.shape[1])), constant_values=-1))
        numbers.append(batch.ids[some])
    points = np.concatenate(nodes)
    places = np.where((points >= 0)[:, :, None], structure.nodes.xyz[np.maximum(points, 0)], 0.0)
    centres = places.sum(axis=1) / np.maximum((points >= 0).sum(axis=1), 1)[:, None]
    few = np.pad(points, ((0, 0), (0, max(0, 4 - width))), constant_values=-1)[:, :4]
    last = np.maximum((few >= 0).sum(axis=1) - 1, 0)
    drawn = np.where(few >= 0, few, np.take_along_axis(few, last[:, None], axis=1))
    return Mesh(points, structure.nodes.xyz[drawn], centres, {int(e): i for i, e in enumerate(np.concatenate(numbers))})
