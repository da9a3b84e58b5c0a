"""Sums over the lines that normal equations of shapes and participations are made of, function by function."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.modal import FrfSet

Reals = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class LineSums:
    """With N = [1/(iω − λ), 1/(iω − λ̄), 1] at the lines that a function h has.

    Parameters
    ----------
    grams : NᴴN, (2m + 1, 2m + 1), one for each pattern of lines
    pattern : (n, u) which of them a function has
    rights : (n, u, 2m + 1) Nᴴh
    squares_of : (n, u) |h|²
    weights : (n,) of the responses
    """

    grams: tuple[Complex, ...]
    pattern: NDArray[np.int64]
    rights: Complex
    squares_of: Reals
    weights: Reals

    @property
    def responses(self) -> int:
        """Number of responses."""
        return len(self.pattern)

    @property
    def references(self) -> int:
        """Number of references."""
        return int(self.pattern.shape[1])

    def shape_of(self, i: int, participations: Complex, direct: bool) -> tuple[Complex, Reals]:
        """ψ (m,) and D (u,) of a response for given participations (m, u)."""
        m, u = participations.shape
        normal, right = np.zeros((2 * m + u, 2 * m + u)), np.zeros(2 * m + u)
        for j in range(u):
            gram, factors = self.grams[self.pattern[i, j]], participations[:, j]
            normal[: 2 * m, : 2 * m] += _normal(gram, factors)
            normal[: 2 * m, 2 * m + j] = normal[2 * m + j, : 2 * m] = _right(gram[:, -1], factors)
            normal[2 * m + j, 2 * m + j] = gram[-1, -1].real
            right[: 2 * m] += _right(self.rights[i, j], factors)
            right[2 * m + j] = self.rights[i, j, -1].real
        size = 2 * m + (u if direct else 0)
        x = _solved(normal[:size, :size], right[:size])
        return x[:m] + 1j * x[m : 2 * m], x[2 * m :] if direct else np.zeros(u)

    def factor_of(self, references: Iterable[int], shapes: Complex, ends: Complex, direct: Reals) -> Complex:
        """x (m,) of Σ_r ψ_ir x_r e_jr/(iω − λ_r) for given ψ (n, m), e (u, m), over all responses."""
        m = shapes.shape[1]
        normal, right = np.zeros((2 * m, 2 * m)), np.zeros(2 * m)
        for j in references:
            for i, weight in enumerate(self.weights):
                gram, factors = self.grams[self.pattern[i, j]], shapes[i] * ends[j]
                normal += weight * _normal(gram, factors)
                right += weight * _right(self.rights[i, j] - direct[i, j] * gram[:, -1], factors)
        x = _solved(normal, right)
        return x[:m] + 1j * x[m:]

    def squares(self, shapes: Complex, participations: Complex, direct: Reals) -> float:
        """Weighted sum of squared errors."""
        total = 0.0
        for i, weight in enumerate(self.weights):
            for j in range(self.references):
                residue = shapes[i] * participations[:, j]
                x = np.concatenate([residue, residue.conj(), [direct[i, j]]])
                model = (x.conj() @ self.grams[self.pattern[i, j]] @ x).real
                cross = (x.conj() @ self.rights[i, j]).real
                total += weight * (self.squares_of[i, j] - 2.0 * cross + model)
        return float(max(total, 0.0))


def line_sums(frfs: FrfSet, near: Complex) -> LineSums:
    """All sums; a response of small motion weighs as much as the others.

    Parameters
    ----------
    near : (k, 2m) columns 1/(iω − λ), then 1/(iω − λ̄)
    """
    n, u, k = frfs.values.shape
    known = np.isfinite(frfs.values).reshape(n * u, k)
    values = np.where(known, frfs.values.reshape(n * u, k), 0.0)
    columns = np.hstack([near, np.ones((k, 1))])
    patterns, which = np.unique(known, axis=0, return_inverse=True)
    grams = tuple(columns[p].conj().T @ columns[p] for p in patterns)
    rights = (values @ columns.conj()).reshape(n, u, -1)
    squares = np.sum(np.abs(values) ** 2, axis=1).reshape(n, u)
    mean = squares.sum(axis=1) / known.sum(axis=1).reshape(n, u).sum(axis=1)
    return LineSums(grams, which.reshape(n, u), rights, squares, 1.0 / np.where(mean > 0.0, mean, 1.0))


def _normal(gram: Complex, factors: Complex) -> Reals:
    """Real normal matrix of the real and imaginary parts of x in x f/(iω − λ) + conjugates."""
    m = len(factors)
    f = np.concatenate([factors, factors.conj()])
    whole = f.conj()[:, None] * gram[: 2 * m, : 2 * m] * f
    a, b, c, d = whole[:m, :m], whole[:m, m:], whole[m:, :m], whole[m:, m:]
    cross = (1j * (a - b + c - d)).real
    return np.block([[(a + b + c + d).real, cross], [cross.T, (a - b - c + d).real]])


def _right(products: Complex, factors: Complex) -> Reals:
    m = len(factors)
    up, down = factors.conj() * products[:m], factors * products[m : 2 * m]
    return np.concatenate([(up + down).real, (up - down).imag])


def _solved(normal: Reals, right: Reals) -> Reals:
    size = np.sqrt(np.diag(normal))
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-14)[0] / size)
