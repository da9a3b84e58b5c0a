"""Block Lanczos on (K − σM)⁻¹M until the wanted pairs have converged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.model.dense_products import add, multiply, transposed_times, turn
from femtune.model.krylov.basis import Basis, Solve
from femtune.model.pencil import pieces
from femtune.model.sparse_products import Product

Reals = NDArray[np.float64]
Chosen = tuple[Reals, Reals, Reals]

BLOCK = 12
_WIDEST = 64
TOLERANCE, LOOSE = 3e-9, 1e-5
"""Residuals of the wanted pairs and of the others before the last smoothing."""
_PATIENCE, _MOST_RESTARTS = 5, 60
_ORTHONORMAL = 1e-12
_BASIS_BYTES = 1_300_000_000
_SEED = 1


@dataclass(frozen=True, eq=False)
class Krylov:
    """What the iteration needs: S = (K − σM)⁻¹M by a solve and a product.

    Parameters
    ----------
    solve : b (n, k) ↦ (K − σM)⁻¹ b
    mass : M
    rank : number of finite eigenvalues, at most
    """

    solve: Solve
    mass: Product
    rank: int


@dataclass(frozen=True, eq=False)
class KrylovPairs:
    """Largest θ (descending) of Sφ = θφ, shapes (n, m) with φᵀMφ = 1, and ‖Sφ − θφ‖_M/θ before the last smoothing.

    `least` is the other end of the spectrum as far as the basis holds it, `solves` counts vectors, `columns` is the
    widest that the basis was.
    """

    theta: Reals
    shapes: Reals
    error: Reals
    least: float
    solves: int
    columns: int


def begin(operator: Krylov, count: int, start: Reals | None = None, block: int = BLOCK) -> Basis:
    """A basis of one block, of `start` (n, c), vectors near the wanted ones, or else at random."""
    random = _Random(operator, min(max(block, 1), _WIDEST, operator.rank))
    basis = Basis(operator.solve, operator.mass, random.width, _most(operator, count, random.width))
    basis.set_block(random.near(start) if _is_usable(start) else random.block())
    return basis


def beside(operator: Krylov, count: int, theta: Reals, shapes: Reals, block: int = BLOCK) -> Basis:
    """A basis that holds pairs that are known exactly, and a random block beside them."""
    random = _Random(operator, min(max(block, 1), _WIDEST, operator.rank))
    basis = Basis(operator.solve, operator.mass, random.width, _most(operator, count, random.width))
    basis.lock(theta, shapes)
    basis.set_block(random.block())
    return basis


def iterate(operator: Krylov, basis: Basis, count: int, wanted: int, tolerance: float = TOLERANCE) -> KrylovPairs:
    """The `count` largest θ, `wanted` of them to a tolerance and the others nearly so.

    What has not converged in the end is returned with its error. Sources: Grimes, Lewis and Simon 1994; Wu and
    Simon 2000 (thick restarts); Ericsson and Ruhe 1980 (the last smoothing).
    """
    count = min(count, operator.rank)
    best, patience, restarts, columns = np.inf, _PATIENCE, _MOST_RESTARTS, 0
    while True:
        pairs, left = _grown(basis, operator, count, (wanted, tolerance))
        columns = max(columns, basis.k)
        patience = _PATIENCE if left < 0.5 * best else patience - 1
        best, restarts = min(best, left), restarts - 1
        if left <= 1.0 or not patience or not restarts or basis.is_exhausted or basis.k >= operator.rank:
            return _finished(basis, *pairs, columns)
        _restart(basis, count)


@dataclass(frozen=True, eq=False)
class _Random:
    """Random blocks that hold no vector of infinite eigenvalue."""

    operator: Krylov
    width: int
    seed: int = _SEED

    def block(self) -> Reals:
        numbers = np.random.default_rng(self.seed).standard_normal((self.width, self.operator.mass.shape[0])).T
        return self.operator.solve(self.operator.mass @ numbers)

    def near(self, start: Reals | None) -> Reals:
        assert start is not None
        mixed = np.random.default_rng(self.seed).standard_normal((start.shape[1], self.width))
        return np.asfortranarray(start @ mixed)


def _is_usable(start: Reals | None) -> bool:
    return start is not None and start.shape[1] > 0 and bool(np.isfinite(start).all())


def _most(operator: Krylov, count: int, block: int) -> int:
    """Columns of the basis: room enough to need no restart, as far as memory is no matter."""
    cheap = _BASIS_BYTES // (8 * operator.mass.shape[0])
    return min(max(2 * count + 4 * block, min(4 * count + 16 * block, cheap)), operator.rank + block)


def _grown(basis: Basis, operator: Krylov, count: int, goal: tuple[int, float]) -> tuple[Chosen, float]:
    """Steps until the basis is full or enough; the chosen pairs, and how far they are from being accepted."""
    while True:
        if not len(basis.B):
            # an invariant subspace: what is left lies in others
            basis.set_block(_Random(operator, basis.width, _SEED + basis.k).block())
        if len(basis.B):
            basis.step()
        stop = basis.is_full or basis.k >= operator.rank or basis.is_exhausted
        if not stop and basis.k < count + basis.width:
            continue
        pairs = _chosen(basis, count)
        left = _left(pairs[2], count, *goal)
        if left <= 1.0 or stop:
            return pairs, left


def _chosen(basis: Basis, count: int) -> Chosen:
    theta, Y, residual = basis.ritz()
    chosen = np.argsort(-theta)[:count]
    size = np.abs(theta[chosen])
    error = np.divide(residual[chosen], size, out=np.full(len(size), np.inf), where=size > 0.0)
    return theta[chosen], Y[:, chosen], error


def _left(error: Reals, count: int, wanted: int, tolerance: float) -> float:
    if len(error) < count:
        return np.inf
    return max(error[:wanted].max(initial=0.0) / tolerance, error[wanted:].max(initial=0.0) / LOOSE)


def _restart(basis: Basis, count: int) -> None:
    theta, Y, _ = _chosen(basis, count + max(BLOCK, (basis.k - count) // 3))
    basis.restart(theta, Y)


def _finished(basis: Basis, theta: Reals, Y: Reals, error: Reals, columns: int) -> KrylovPairs:
    """Ritz vectors y, smoothed to Sy/θ by the relation SV = VT + QB without a solve, and made M-orthonormal again."""
    inverse = np.divide(1.0, theta, out=np.zeros_like(theta), where=theta != 0.0)
    shapes = multiply(basis.vectors, Y)
    if len(basis.B):
        add(shapes, basis.next, (basis.B @ Y) * inverse)
    gram = _gram(shapes, basis.mass)
    if np.abs(gram - np.eye(len(theta))).max(initial=0.0) > _ORTHONORMAL:
        shapes = turn(shapes, 1.5 * np.eye(len(theta)) - 0.5 * gram)
        gram = _gram(shapes, basis.mass)
    shapes /= np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    return KrylovPairs(theta, shapes, error, basis.least, basis.solves, columns)


def _gram(shapes: Reals, mass: Product) -> Reals:
    """ΦᵀMΦ, some columns at a time."""
    out = np.empty((shapes.shape[1], shapes.shape[1]))
    for some in pieces(0, len(out)):
        out[:, some] = transposed_times(shapes, mass @ shapes[:, some])
    return out
