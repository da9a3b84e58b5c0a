"""Block Lanczos on (K − σM)⁻¹M until the wanted pairs have converged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.model.eigen.pencil import pieces
from femtune.model.linear.dense_products import add, multiply, subtract, symmetric_eigen, transposed_times, turn
from femtune.model.linear.sparse_products import Product

# ----------------------------------------------------------------------------------------------------
# M-orthonormal blocks: classical Gram-Schmidt by blocks, with a rank that is revealed rather than assumed.


_GRAM_RANK = 1e-14
"""Eigenvalues of a block's Gram matrix (of unit diagonal) that are smaller, relative to the largest, are rounding of
the Gram matrix and not directions of the block."""
_GRAM_FLOOR = 1e-16
"""Value that replaces smaller eigenvalues in the first sweep, so that a direction is enlarged by at most 1e8."""
_VANISHED_NORM = 1e-4
"""Norm below which a direction of unit length has vanished in a sweep: what is left of it is mostly rounding."""
_GOOD_CONDITION = 1e3
"""A block whose coefficients have a smaller condition number keeps all but three digits of its orthogonality."""
_MOST_SWEEPS = 4
"""Gram-Schmidt sweeps over one block; two are enough unless the block is nearly dependent."""
_NEGLIGIBLE_PART = 1e-12
"""Part in the basis, relative to the block that is left, whose product with M need not be computed again."""


def orthonormalise(W: Reals, V: Reals, mass: Product, smallest: float) -> tuple[Reals, Reals, Reals]:
    """Q (n, r) with VᵀMQ = 0 and QᵀMQ = 1, MQ, and B (r, b) with W = Q B + (a part in V that is rounding).

    Parameters
    ----------
    W : (n, b) in Fortran's order, overwritten; its part in V is small or known to the caller
    V : (n, k), M-orthonormal
    smallest : columns of W whose M-norm is below this are rounding and are dropped

    Sources: block classical Gram-Schmidt, twice; Stathopoulos and Wu 2002 (orthonormalisation by the Gram matrix).
    """
    total = np.eye(W.shape[1])
    for sweep in range(_MOST_SWEEPS):
        MW = mass @ W
        C = transposed_times(V, MW)
        subtract(W, V, C)
        R, condition, change = _factors(transposed_times(W, MW), smallest, clipped=sweep == 0)
        W, MW, total = multiply(W, R), multiply(MW, R), change @ total
        removed = float(np.abs(C @ R).max(initial=0.0))
        smallest = _VANISHED_NORM
        if max(condition, removed) < _GOOD_CONDITION or not W.shape[1]:
            break
    return _once_more(W, MW if removed < _NEGLIGIBLE_PART else mass @ W, total)


def _once_more(W: Reals, MW: Reals, total: Reals) -> tuple[Reals, Reals, Reals]:
    """Correct the remaining rounding of the first Gram matrix, inside the block."""
    if W.shape[1]:
        R, _, change = _factors(transposed_times(W, MW), 0.0)
        W, MW, total = multiply(W, R), multiply(MW, R), change @ total
    return W, MW, total


def _factors(gram: Reals, smallest: float, clipped: bool = False) -> tuple[Reals, float, Reals]:
    """R (b, r) with RᵀGR = 1, the condition of the columns, and R's left inverse (r, b).

    Directions that are rounding are left out, or kept as they are clipped: then RᵀGR is smaller there.
    """
    norms = np.sqrt(np.maximum(np.diag(gram), 0.0))
    some = norms > smallest
    scale = np.divide(1.0, norms, out=np.zeros_like(norms), where=some)
    if not some.any():
        return np.zeros((len(norms), 0)), 1.0, np.zeros((0, len(norms)))
    values, vectors = la.eigh(0.5 * scale[:, None] * (gram + gram.T) * scale)
    keep = some if clipped and some.all() else values > _GRAM_RANK * values[-1]
    root = np.sqrt(np.maximum(values[keep], _GRAM_FLOOR * values[-1]))
    R = scale[:, None] * vectors[:, keep] / root
    change = (root[:, None] * vectors[:, keep].T) * norms
    return R, float(root[-1] / root[0]), change


def column_products(A: Reals, B: Reals) -> Reals:
    """a_jᵀb_j of the columns of two arrays in Fortran's order."""
    return np.array([a @ b for a, b in zip(A.T, B.T, strict=True)])


# ----------------------------------------------------------------------------------------------------
# The growing basis of a block Lanczos iteration and the matrix of the inverted operator on it.


Solve = Callable[[Reals], Reals]

_ROUNDING = 1e-15
"""Norm of a new direction relative to ‖S‖ that is rounding: a few units in the last place."""


class KrylovBasis:
    """V (n, k + b), M-orthonormal, with S V_k = V_k T + Q B for S = (K − σM)⁻¹M, symmetric in the M-product.

    `vectors` are V_k and `next` is Q, the last b columns. T (k, k) is symmetric, and B (b, k) couples the next block to
    the last block before it, or to all of the basis after a restart.
    """

    def __init__(self, solve: Solve, mass: Product, width: int, most: int) -> None:
        self.solve, self.mass, self.width = solve, mass, width
        # memory is taken only where it is written, a column at a time
        self._V = np.empty((mass.shape[0], most + width), order="F")
        self.k, self.solves = 0, 0
        self.T, self.B = np.zeros((0, 0)), np.zeros((0, 0))
        self._norm, self._first = 0.0, 0
        self._heavy = np.zeros((mass.shape[0], 0))
        self.is_exhausted = False
        """True where a fresh block had nothing outside the basis."""

    def lock(self, theta: Reals, shapes: Reals) -> None:
        """Begin with pairs that are known."""
        self.k = len(theta)
        self._V[:, : self.k] = shapes
        self.T, self.B, self._norm = np.diag(theta), np.zeros((0, self.k)), float(np.abs(theta).max(initial=0.0))

    @property
    def vectors(self) -> Reals:
        """(n, k) without the next block."""
        return self._V[:, : self.k]

    @property
    def next(self) -> Reals:
        """(n, b) the next block."""
        return self._V[:, self.k : self.k + len(self.B)]

    @property
    def is_full(self) -> bool:
        """True where the next block has no room."""
        return self.k > self.room

    @property
    def room(self) -> int:
        """Columns that leave room for two blocks after them."""
        return self._V.shape[1] - 2 * (len(self.B) or self.width)

    def set_block(self, W: Reals) -> Reals:
        """Make W, freed of the basis, the next block; returns B of W = QB. The coupling to the basis is left zero."""
        Q, MQ, B = orthonormalise(np.asfortranarray(W), self.vectors, self.mass, _ROUNDING * self._norm)
        room = self._V.shape[1] - self.k
        Q, self._heavy = Q[:, :room], MQ[:, :room]
        self._V[:, self.k : self.k + Q.shape[1]] = Q
        self.is_exhausted = not Q.shape[1] and not len(self.B)
        self.B = np.zeros((Q.shape[1], self.k))
        return B

    def step(self) -> None:
        """Take the next block into the basis, and make the one after it."""
        k, b, B = self.k, len(self.B), self.B
        P = self._heavy
        W = np.asfortranarray(self.solve(P))
        self.solves += b
        A = transposed_times(W, P)
        A = 0.5 * (A + A.T)
        subtract(W, self._V[:, self._first : k + b], np.vstack([B.T[self._first :], A]))
        self.T = np.block([[self.T, B.T], [B, A]])
        self._norm = max(self._norm, float(la.norm(A, 2)))
        self._first, self.k = k, k + b
        coupling = self.set_block(W)
        self.B[:, k:] = coupling

    def ritz(self) -> tuple[Reals, Reals, Reals]:
        """θ ascending, their vectors (k, k) and residual norms ‖Sy − θy‖_M."""
        theta, Y = symmetric_eigen(self.T)
        return theta, Y, la.norm(self.B @ Y, axis=0) if len(self.B) else np.zeros(len(theta))

    @property
    def least(self) -> float:
        """The smallest θ of the basis."""
        return float(la.eigvalsh(self.T, subset_by_index=(0, 0))[0])

    def give_back(self) -> None:
        """Give the memory of the vectors back; what is left is T."""
        self._V = self._heavy = np.zeros((self._V.shape[0], 0))

    def restart(self, theta: Reals, Y: Reals) -> None:
        """Keep the chosen Ritz vectors V Y, with their coupling to the next block (a thick restart)."""
        theta, Y = theta[: self.room], Y[:, : self.room]
        k, kept = self.k, len(theta)
        turn(self._V, Y)
        b = len(self.B)
        self._V[:, kept : kept + b] = self._V[:, k : k + b].copy()
        self.T, self.B = np.diag(theta), self.B @ Y
        self._first, self.k = 0, kept


Chosen = tuple[Reals, Reals, Reals]

BLOCK = 12
"""Columns of a block: wide enough for solves of several right-hand sides and for the six rigid-body modes, and narrow
enough for the Krylov space to grow long."""
_WIDEST_BLOCK = 64
"""Columns of a block at most: wider ones leave too few steps for the size of the basis."""
TOLERANCE = 3e-9
"""Residual of the wanted pairs before the last smoothing; the error of an eigenvalue is of the order of its square."""
TOLERANCE_OF_OTHERS = 1e-5
"""Residual of the pairs beyond the wanted ones before the last smoothing."""
_PATIENCE = 5
"""Restarts in a row that may fail to halve the residual before the iteration gives up."""
MOST_RESTARTS = 60
"""Restarts after which the iteration gives up; `_PATIENCE` ends it much earlier where it does not converge."""
_ORTHONORMALITY = 1e-12
"""Largest error of ΦᵀMΦ above which the shapes are made orthonormal once more."""
_BASIS_BYTES = 1_300_000_000
"""Memory that the basis may take to save restarts."""
_SEED = 1
"""Of the random start, so that a solution is repeated exactly."""


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


def begin(operator: Krylov, count: int, start: Reals | None = None, block: int = BLOCK) -> KrylovBasis:
    """A basis of one block, of `start` (n, c), vectors near the wanted ones, or else at random."""
    random = _Random(operator, min(max(block, 1), _WIDEST_BLOCK, operator.rank))
    basis = KrylovBasis(operator.solve, operator.mass, random.width, most_columns(operator, count, random.width))
    basis.set_block(random.near(start) if _is_usable(start) else random.block())
    return basis


def beside(operator: Krylov, count: int, theta: Reals, shapes: Reals, block: int = BLOCK) -> KrylovBasis:
    """A basis that holds pairs that are known exactly, and a random block beside them."""
    random = _Random(operator, min(max(block, 1), _WIDEST_BLOCK, operator.rank))
    basis = KrylovBasis(operator.solve, operator.mass, random.width, most_columns(operator, count, random.width))
    basis.lock(theta, shapes)
    basis.set_block(random.block())
    return basis


def iterate(operator: Krylov, basis: KrylovBasis, count: int, wanted: int, tolerance: float = TOLERANCE) -> KrylovPairs:
    """The `count` largest θ, `wanted` of them to a tolerance and the others nearly so.

    Pairs that have not converged are returned with their error. Sources: Grimes, Lewis and Simon 1994; Wu and
    Simon 2000 (thick restarts); Ericsson and Ruhe 1980 (the last smoothing).
    """
    count = min(count, operator.rank)
    best, patience, restarts, columns = np.inf, _PATIENCE, MOST_RESTARTS, 0
    while True:
        pairs, left = _grown(basis, operator, count, (wanted, tolerance))
        columns = max(columns, basis.k)
        patience = _PATIENCE if left < 0.5 * best else patience - 1
        best, restarts = min(best, left), restarts - 1
        if left <= 1.0 or not patience or not restarts or basis.is_exhausted or basis.k >= operator.rank:
            converged = finished_pairs(basis, *pairs, columns)
            basis.give_back()
            return converged
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


def most_columns(operator: Krylov, count: int, block: int) -> int:
    """Columns of the basis: enough to need no restart, within the memory allowed."""
    cheap = _BASIS_BYTES // (8 * operator.mass.shape[0])
    return min(max(2 * count + 4 * block, min(4 * count + 16 * block, cheap)), operator.rank + block)


def _grown(basis: KrylovBasis, operator: Krylov, count: int, goal: tuple[int, float]) -> tuple[Chosen, float]:
    """Steps until the basis is full or enough; the chosen pairs, and how far they are from being accepted."""
    while True:
        if not len(basis.B):
            # an invariant subspace: the remaining pairs lie outside it
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


def _chosen(basis: KrylovBasis, count: int) -> Chosen:
    theta, Y, residual = basis.ritz()
    chosen = np.argsort(-theta)[:count]
    size = np.abs(theta[chosen])
    error = np.divide(residual[chosen], size, out=np.full(len(size), np.inf), where=size > 0.0)
    return theta[chosen], Y[:, chosen], error


def _left(error: Reals, count: int, wanted: int, tolerance: float) -> float:
    if len(error) < count:
        return np.inf
    return max(error[:wanted].max(initial=0.0) / tolerance, error[wanted:].max(initial=0.0) / TOLERANCE_OF_OTHERS)


def _restart(basis: KrylovBasis, count: int) -> None:
    theta, Y, _ = _chosen(basis, count + max(BLOCK, (basis.k - count) // 3))
    basis.restart(theta, Y)


def finished_pairs(basis: KrylovBasis, theta: Reals, Y: Reals, error: Reals, columns: int) -> KrylovPairs:
    """Ritz vectors y, smoothed to Sy/θ by the relation SV = VT + QB without a solve, and made M-orthonormal again."""
    inverse = np.divide(1.0, theta, out=np.zeros_like(theta), where=theta != 0.0)
    shapes = multiply(basis.vectors, Y)
    if len(basis.B):
        add(shapes, basis.next, (basis.B @ Y) * inverse)
    gram = _gram(shapes, basis.mass)
    if np.abs(gram - np.eye(len(theta))).max(initial=0.0) > _ORTHONORMALITY:
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
