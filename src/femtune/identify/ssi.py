"""Stochastic subspace identification, driven by covariances or by data (Van Overschee and De Moor 1996).

Responses to noise that nobody measured: x(t+1) = A x + w, y = C x + v. Frequencies, damping and shapes come with their
standard deviations (covariance-driven form) from the scatter of the correlations over pieces of the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.identify.hankel import block_hankel
from femtune.identify.natural_excitation import correlations_by_block
from femtune.identify.realisation import Observability

Reals = NDArray[np.float64]

_CHUNK = 4096


@dataclass(frozen=True, eq=False)
class CovarianceModel:
    """Covariance-driven subspace model.

    Parameters
    ----------
    observability : O of the largest order
    left, singular_values, right : all of the Hankel matrix H = U diag(s) Vᵀ
    scatter : (blocks, rows, columns) deviations of the blocks' Hankel matrices from their mean, over √(b(b−1)): the
        covariance of H is the sum of their outer products
    """

    observability: Observability
    left: Reals
    singular_values: Reals
    right: Reals
    scatter: Reals

    @cached_property
    def images(self) -> tuple[Reals, Reals]:
        """UᵀδH V (blocks, k, k) of each movement, and what δH V (blocks, rows, k) has outside of the span of U."""
        moved = self.scatter @ self.right
        within = self.left.T @ moved
        return within, moved - self.left @ within


def covariance_driven(
    values: Reals, step_s: float, references: Sequence[int], rows: int, order: int, blocks: int = 20
) -> CovarianceModel:
    """SSI-cov with reference channels (Peeters and De Roeck 1999).

    Parameters
    ----------
    values : (s, n) responses without mean
    references : channels whose past is used
    rows : block rows and columns of the Hankel matrix
    order : largest model order, at most rows times the number of references
    blocks : pieces of the record for the standard deviations
    """
    pieces = correlations_by_block(values, references, 2 * rows, blocks)
    mean = block_hankel(pieces.mean(axis=0), rows + 1, rows)
    u, s, vt = np.linalg.svd(mean, full_matrices=False)
    deviations = np.stack([block_hankel(p, rows + 1, rows) - mean for p in pieces])
    scatter = deviations / np.sqrt(blocks * (blocks - 1.0))
    seen = Observability(u[:, :order] * np.sqrt(s[:order]), len(values), step_s)
    return CovarianceModel(seen, u, s, vt.T, scatter)


def data_driven(values: Reals, step_s: float, references: Sequence[int], rows: int, order: int) -> Observability:
    """SSI-data with reference channels, unweighted principal components: the projection of the future on the past.

    The block Hankel matrix of the data is never formed: its triangular factor is brought up to date piece by piece.
    """
    factor = _triangular_factor(values, references, rows)
    past = len(references) * rows
    # rows: past, future; lower triangular L: the projection of the future on the past is L21 Q1
    u, s, _ = np.linalg.svd(factor[past:, :past], full_matrices=False)
    return Observability(u[:, :order] * s[:order], len(values), step_s)


def _triangular_factor(values: Reals, references: Sequence[int], rows: int) -> Reals:
    """L (lower) of the Hankel matrix [past references; future responses] = L Q, by QR of its transpose in pieces."""
    n = values.shape[1] - 2 * rows
    size = rows * len(references) + (rows + 1) * len(values)
    r: Reals = np.zeros((0, size))
    step = max(_CHUNK, 4 * size)
    for begin in range(0, n, step):
        piece = _data_rows(values, references, rows, begin, min(begin + step, n))
        r = np.asarray(np.linalg.qr(np.vstack([r, piece]), mode="r"))
    return np.asarray(r.T / np.sqrt(n))


def _data_rows(values: Reals, references: Sequence[int], rows: int, begin: int, end: int) -> Reals:
    """(end − begin, size) samples of the past references and the future responses at each instant."""
    at = np.arange(begin, end)
    past = [values[list(references)][:, at + i].T for i in range(rows)]
    future = [values[:, at + rows + i].T for i in range(rows + 1)]
    return np.hstack([*past, *future])
