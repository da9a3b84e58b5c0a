"""Our element matrices, of a deck that was read, in the form in which the commercial program's are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from op2 import ElementMatrix

from femtune.fem.assemble import assemble, nominal_matrices
from femtune.fem.elements import contributions
from femtune.fem.fields import MatrixKind
from femtune.fem.structure import ElementBatch, Structure

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]
Change = Callable[[Reals, Reals], Reals]
"""Corners (n, 2) and our matrix of some components of them -> a matrix of the same size."""

MEMBRANE, BENDING = (0, 1, 5), (2, 3, 4)
"""Components of a corner on the axes of a flat shell."""


@dataclass(frozen=True)
class OurMatrix:
    """A matrix of one element: its card, g-set rows and values."""

    card: str
    dofs: Integers
    matrix: Reals

    def on(self, dofs: Integers) -> Reals:
        """The matrix in another order of rows; rows that it does not have are zero."""
        place = {int(d): i for i, d in enumerate(self.dofs)}
        out, at = np.zeros((len(dofs), len(dofs))), np.array([place.get(int(d), -1) for d in dofs])
        some = np.flatnonzero(at >= 0)
        out[np.ix_(some, some)] = self.matrix[np.ix_(at[some], at[some])]
        return out


def our_matrices(structure: Structure, kind: MatrixKind) -> dict[int, OurMatrix]:
    """Element matrices by element number."""
    out: dict[int, OurMatrix] = {}
    for batch in structure.batches:
        sums = _sums(batch, structure, kind)
        out |= {int(n): OurMatrix(batch.card, batch.dofs[i], sums[i]) for i, n in enumerate(batch.ids)}
    return out


def _sums(batch: ElementBatch, structure: Structure, kind: MatrixKind) -> Reals:
    out = np.zeros((len(batch), batch.dofs.shape[1], batch.dofs.shape[1]))
    for term in contributions(batch, structure):
        if term.matrix == kind:
            out[term.at] += nominal_matrices(batch, structure, term)
    return out


def dofs_of(matrix: ElementMatrix) -> Integers:
    """g-set rows of a matrix of the commercial program."""
    return np.concatenate([np.arange(row, row + matrix.components) for row in matrix.rows])


def difference(theirs: ElementMatrix, ours: OurMatrix) -> float:
    """Norm of the difference over the norm of theirs."""
    at = dofs_of(theirs)
    every = np.union1d(at, ours.dofs)
    a = OurMatrix("", at, theirs.matrix).on(every)
    return float(np.linalg.norm(a - ours.on(every)) / np.linalg.norm(a))


def shell_axes(xyz: Reals) -> tuple[Reals, Reals]:
    """(n, 2) corners of a flat shell on its own axes, and these axes as rows: along side 12, across, normal."""
    x = xyz[1] - xyz[0]
    normal = np.cross(x, xyz[2] - xyz[0])
    axes = np.stack([v / np.linalg.norm(v) for v in (x, np.cross(normal, x), normal)])
    return (xyz - xyz[0]) @ axes[:2].T, axes


def part(matrix: Reals, axes: Reals, components: tuple[int, ...]) -> Reals:
    """Rows and columns of some components of every corner, on a flat shell's axes."""
    n = len(matrix) // 6
    turn = np.kron(np.eye(2 * n), axes)
    at = [6 * i + c for i in range(n) for c in components]
    return np.asarray((turn @ matrix @ turn.T)[np.ix_(at, at)])


def on_shells(structure: Structure, card: str, components: tuple[int, ...], change: Change) -> Reals:
    """g-set matrix of something on some components of the shells of a card."""
    n, ours = structure.nodes.n_dofs, our_matrices(structure, "stiffness")
    out = np.zeros((n, n))
    for batch in (b for b in structure.batches if b.card == card):
        for number, nodes in zip(batch.ids, batch.nodes):
            corners, axes = shell_axes(structure.nodes.xyz[nodes])
            dofs = np.concatenate([6 * row + np.arange(6) for row in nodes])
            rows = np.kron(np.eye(2 * len(nodes)), axes)
            rows = rows[[6 * i + c for i in range(len(nodes)) for c in components]]
            own = rows @ ours[int(number)].on(dofs) @ rows.T
            out[np.ix_(dofs, dofs)] += rows.T @ change(corners, own) @ rows
    return out


def frequencies(structure: Structure, stiffness: Reals, rigid: int, count: int) -> Reals:
    """Elastic natural frequencies in Hz under the deck's supports; massless freedoms are no modes."""
    held = structure.permanent.tolist()
    if structure.default_support_set is not None:
        held += structure.support_sets[structure.default_support_set].tolist()
    free = np.setdiff1d(np.arange(structure.nodes.n_dofs), held)
    free = free[np.abs(stiffness[free]).max(axis=1) > 0.0]
    K, M = (matrix[np.ix_(free, free)] for matrix in (stiffness, assemble(structure, "mass").toarray()))
    shift = 1e-6 * np.trace(K) / np.trace(M)
    inverse = scipy.linalg.eigh(M, K + shift * M, eigvals_only=True)[::-1][: rigid + count]
    return np.asarray(np.sqrt(np.maximum(1.0 / inverse - shift, 0.0)) / (2.0 * np.pi))[rigid:]
