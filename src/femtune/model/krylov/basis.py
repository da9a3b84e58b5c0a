"""The growing basis of a block Lanczos iteration and the matrix of the inverted operator on it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from femtune.model.dense_products import subtract, transposed_times, turn
from femtune.model.krylov.orthonormal import orthonormalise
from femtune.model.sparse_products import Product

Reals = NDArray[np.float64]
Solve = Callable[[Reals], Reals]

_ROUNDING = 1e-15


class Basis:
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
        theta, Y = la.eigh(self.T)
        return theta, Y, la.norm(self.B @ Y, axis=0) if len(self.B) else np.zeros(len(theta))

    @property
    def least(self) -> float:
        """The smallest θ of the basis."""
        return float(la.eigvalsh(self.T, subset_by_index=(0, 0))[0])

    def restart(self, theta: Reals, Y: Reals) -> None:
        """Keep the chosen Ritz vectors V Y, with their coupling to the next block (a thick restart)."""
        theta, Y = theta[: self.room], Y[:, : self.room]
        k, kept = self.k, len(theta)
        turn(self._V, Y)
        b = len(self.B)
        self._V[:, kept : kept + b] = self._V[:, k : k + b].copy()
        self.T, self.B = np.diag(theta), self.B @ Y
        self._first, self.k = 0, kept
