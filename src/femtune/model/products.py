"""Products with single terms of a configured model and with its derivatives, without assembling a matrix of their own.

Everything that needs ∂K/∂p asks here: eigenvalue derivatives (φᵀK′φ), forces of eigenvector derivatives (K′φ), and
projections of the whole term list on a basis (VᵀK_tV). Only the rows of the DOFs that a coefficient's elements have
are touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.fields import MatrixKind
from femtune.model.configured import ConfiguredModel, ModelPoint
from femtune.model.linear.dense_products import in_any_order
from femtune.model.linear.memory import require_memory
from femtune.parameters.jet import Jet

_ROWS_AT_ONCE = 1 << 16
"""Rows of a block of vectors that are copied together, so that no second array of its size is made."""
COLUMNS_AT_ONCE = 48
"""Columns of a product that are computed together: a large model has room for them beside its basis."""
MANY_COLUMNS = 8
"""Columns for each parameter above which their sum for that parameter is formed first."""


@dataclass(frozen=True, eq=False)
class Local:
    """A symmetric matrix A = U + Uᵀ on the DOFs that it has: `half` is U, its upper triangle with half the diagonal."""

    dofs: NDArray[np.int64]
    half: sp.csr_array

    def times(self, vectors: Reals) -> Reals:
        """A v for the rows (d, m) of its DOFs."""
        return np.asarray(self.half @ vectors + self.half.T @ vectors)

    def energies(self, vectors: Reals) -> Reals:
        """(m,) vᵀA v of all columns of (n_free, m)."""
        rows = np.ascontiguousarray(vectors[self.dofs])
        return np.asarray(2.0 * np.einsum("ij,ij->j", rows, self.half @ rows))

    def sandwich(self, left: Reals, right: Reals) -> Reals:
        """(a, b) leftᵀA right for (n_free, a) and (n_free, b)."""
        out = np.zeros((left.shape[1], right.shape[1]), np.result_type(left, right, self.half))
        if left is right:
            local = np.ascontiguousarray(right[self.dofs])
            for part in _parts(right.shape[1]):
                out[:, part] = in_any_order(local.T, self.half @ np.ascontiguousarray(local[:, part]))
            return np.asarray(out + out.T)
        for part in _parts(right.shape[1]):
            driven = self.times(np.ascontiguousarray(right[:, part][self.dofs]))
            for first in range(0, len(driven), _ROWS_AT_ONCE):
                rows = slice(first, first + _ROWS_AT_ONCE)
                out[:, part] += in_any_order(np.ascontiguousarray(left[self.dofs[rows]]).T, driven[rows])
        return out


def _parts(count: int) -> list[slice]:
    """Columns of a product at a time: as many as the memory of a large model has room for, beside its basis."""
    return [slice(i, min(i + COLUMNS_AT_ONCE, count)) for i in range(0, count, COLUMNS_AT_ONCE)]


def projections(configured: ConfiguredModel, kind: MatrixKind, left: Reals, right: Reals) -> dict[int, Reals]:
    """leftᵀ K_c right of every column c of every term of a kind, (n_columns, a, b) by its position in `projected`.

    `left` (n_free, a) and `right` (n_free, b); where they are one array, half the work is done.

    Raises
    ------
    FemtuneError : ``model.memory``
    """
    chosen = {i: p.term.n_columns for i, p in enumerate(configured.projected) if p.term.matrix == kind}
    size = left.shape[1] * right.shape[1]
    terms = sum(chosen.values())
    require_memory(8 * size * terms, "model.memory/projecting", terms=terms)
    out = {i: np.empty((n, left.shape[1], right.shape[1])) for i, n in chosen.items()}
    for i, n in chosen.items():
        for c in range(n):
            out[i][c] = column(configured, i, c).sandwich(left, right)
    return out


def column(configured: ConfiguredModel, i: int, c: int) -> Local:
    """Column c of the projected term i."""
    spread = configured.projected[i].spread
    at = slice(spread.indptr[c], spread.indptr[c + 1])
    return _local(configured, spread.indices[at], spread.data[at])


def _local(configured: ConfiguredModel, places: NDArray, data: Reals) -> Local:
    """The matrix with these entries; `places` ascend."""
    rows, cols = configured.rows[places], configured.indices[places]
    has = np.zeros(configured.n_free, bool)
    has[rows] = has[cols] = True
    dofs = np.flatnonzero(has)
    number = np.empty(configured.n_free, np.int32)
    number[dofs] = np.arange(len(dofs), dtype=np.int32)
    starts = np.searchsorted(rows, np.append(dofs, configured.n_free)).astype(np.int32)
    half = np.where(rows == cols, 0.5 * data, data)
    return Local(dofs, sp.csr_array((half, number[cols], starts), shape=(len(dofs), len(dofs))))


def _moving(point: ModelPoint, kind: MatrixKind) -> Iterator[tuple[int, Jet]]:
    """Positions of the terms of a kind that parameters move, and their coefficients."""
    point.check_frequency(kind)
    for i, (p, c) in enumerate(zip(point.configured.projected, point.coefficients)):
        if p.term.matrix == kind and c is not None:
            yield i, c


def _moving_columns(point: ModelPoint, kind: MatrixKind) -> Iterator[tuple[Local, NDArray[np.int64], Reals]]:
    """Matrices that parameters move, these parameters, and the factors with which they enter the derivatives."""
    for i, jet in _moving(point, kind):
        moved = np.flatnonzero(jet.grad.any(axis=1))
        if len(moved) > MANY_COLUMNS * point.n_parameters:
            for k in np.flatnonzero(jet.grad.any(axis=0)):
                yield _combined(point.configured, i, jet.grad[:, k]), np.array([k]), np.ones(1)
            continue
        for c in moved:
            parameters = np.flatnonzero(jet.grad[c])
            yield column(point.configured, i, int(c)), parameters, jet.grad[c, parameters]


def derivative_projections(point: ModelPoint, kind: MatrixKind, left: Reals, right: Reals) -> Reals:
    """leftᵀ (∂K/∂x_i) right of every free parameter, (k, a, b)."""
    out = np.zeros((point.n_parameters, left.shape[1], right.shape[1]))
    for local, parameters, slopes in _moving_columns(point, kind):
        one = local.sandwich(left, right)
        for i, slope in zip(parameters, slopes):
            out[i] += slope * one
    return out


def derivative_energies(point: ModelPoint, kind: MatrixKind, vectors: Reals) -> Reals:
    """vᵀ (∂K/∂x_i) v of every free parameter and every column v of `vectors`, (k, m)."""
    out = np.zeros((point.n_parameters, vectors.shape[1]))
    for local, parameters, slopes in _moving_columns(point, kind):
        out[parameters] += slopes[:, None] * local.energies(vectors)
    return out


def derivative_product(point: ModelPoint, kind: MatrixKind, parameter: int, vectors: Reals) -> Reals:
    """(∂K/∂x_i) V, (n_free, m)."""
    out = np.zeros((point.configured.n_free, vectors.shape[1]))
    for i, jet in _moving(point, kind):
        local = _combined(point.configured, i, jet.grad[:, parameter])
        out[local.dofs] += local.times(np.ascontiguousarray(vectors[local.dofs]))
    return out


def _combined(configured: ConfiguredModel, i: int, weights: Reals) -> Local:
    """Σ_c weight_c K_c of the projected term i."""
    spread, some = configured.projected[i].spread, np.flatnonzero(weights)
    if len(some) == 1:
        at = slice(spread.indptr[some[0]], spread.indptr[some[0] + 1])
        return _local(configured, spread.indices[at], weights[some[0]] * spread.data[at])
    columns, factors = (spread, weights) if len(some) > MANY_COLUMNS else (spread[:, some], weights[some])
    data = columns @ factors
    places = np.flatnonzero(data)
    return _local(configured, places, data[places])
