"""Stochastic subspace identification, driven by covariances or by data (Van Overschee and De Moor 1996).

Responses to unmeasured noise: x(t+1) = A x + w, y = C x + v. Frequencies, damping and shapes come with their
standard deviations (covariance-driven form) from the variance of the correlations over segments of the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.identification.quantities import in_one_quantity, moved_in_one_quantity
from femtune.identification.realisation import Observability, Poles, block_hankel, correlations_by_block
from femtune.modal.shape_criteria import turn_to_real_axis

_CHUNK = 4096
"""Rows of a block of the stepwise QR decomposition: it bounds the memory."""


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
    def images(self) -> tuple[Reals, Reals, Reals]:
        """UᵀδH V of each movement, as far as orders up to the largest, n, need it.

        Its first n columns (blocks, k, n) and rows (blocks, n, k), and what the first n columns of δH V (blocks, rows,
        n) have outside of the span of U.
        """
        n = self.observability.matrix.shape[1]
        moved = self.scatter @ self.right[:, :n]
        columns = self.left.T @ moved
        return columns, (self.left[:, :n].T @ self.scatter) @ self.right, moved - self.left @ columns


def supported_order(model: CovarianceModel) -> int | None:
    """The least order beyond which the correlations have no more than their scatter explains; None beyond the largest.

    What an order n leaves of the Hankel matrix, Σ s² beyond n, is compared with the mean energy that the scatter of the
    record's pieces has there, outside of the first n left and right singular vectors.
    """
    columns, rows, outside = model.images
    n = columns.shape[2]
    right = np.cumsum(np.sum(columns**2, axis=(0, 1)) + np.sum(outside**2, axis=(0, 1)))
    left = np.cumsum(np.sum(rows**2, axis=(0, 2)))
    both = np.diag(np.cumsum(np.cumsum(np.sum(columns[:, :n] ** 2, axis=0), axis=0), axis=1))
    noise = float(np.sum(model.scatter**2)) - left - right + both
    rest = float(np.sum(model.singular_values**2)) - np.cumsum(model.singular_values[:n] ** 2)
    enough = np.flatnonzero(rest <= noise)
    return int(enough[0]) + 1 if len(enough) else None


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


# ----------------------------------------------------------------------------------------------------
# Standard deviations of modes from covariance-driven subspace identification, by first-order perturbation.
#
# The variance of the correlations over segments of the record changes the Hankel matrix, which changes its singular
# vectors, these the state matrix, and this the poles and shapes. Sources: E. Reynders, R. Pintelon, G. De Roeck (2008),
# Mechanical Systems and Signal Processing 22; M. Döhler, L. Mevel (2013), Mechanical Systems and Signal Processing 38.


@dataclass(frozen=True, eq=False)
class PoleScatter:
    """How poles and shapes of one order move with each piece of the record; squares add up to variances.

    Parameters
    ----------
    found : the poles themselves
    poles : (b, m) movements of λ, rad/s
    shapes : (b, s, m) movements of the shapes as they are scaled in `found`
    """

    found: Poles
    poles: Complexes
    shapes: Complexes

    @property
    def freq_sd_hz(self) -> Reals:
        """(m,) standard deviations of the frequencies."""
        unit = self.found.poles / np.abs(self.found.poles)
        return _root_sum((unit.conj() * self.poles).real / (2.0 * np.pi))

    @property
    def damping_sd(self) -> Reals:
        """(m,) standard deviations of the damping ratios."""
        pole, size = self.found.poles, np.abs(self.found.poles)
        growth = (pole.conj() * self.poles).real / size**2
        return _root_sum(-self.poles.real / size - self.found.damping_ratio * growth)

    @property
    def shapes_sd(self) -> Reals:
        """(s, m) standard deviations of the real shapes of unit norm that belong to the complex ones."""
        turned, moved = _real_parts(self.found.shapes, self.shapes)
        along = np.einsum("sm,bsm->bm", turned, moved)
        return _root_sum(moved - turned[None] * along[:, None])

    def in_one_quantity(self, derivatives: Reals) -> PoleScatter:
        """The same with shapes of one quantity, where the channels have other `derivatives` (s,) of the motion."""
        at, shapes = self.found.poles, self.found.shapes
        moved = moved_in_one_quantity(shapes, self.shapes, at, self.poles, derivatives)
        return PoleScatter(replace(self.found, shapes=in_one_quantity(shapes, at, derivatives)), self.poles, moved)


def _root_sum(moves: Reals) -> Reals:
    return np.asarray(np.sqrt((moves**2).sum(axis=0)))


def _real_parts(shapes: Complexes, moves: Complexes) -> tuple[Reals, Reals]:
    """Real parts, unit norm, of shapes turned to the real axis, and their movements."""
    phase = turn_to_real_axis(shapes)
    real = (shapes * phase).real
    length = np.linalg.norm(real, axis=0)
    return real / length, (moves * phase).real / length


def scatter_of_order(model: CovarianceModel, order: int) -> PoleScatter:
    """Poles of one order with their perturbations from the segments of the record."""
    seen = model.observability
    basis = model.left[:, :order]
    moved = _moved_basis(model, order)
    s = seen.channels
    upper, lower = basis[:-s], basis[s:]
    inverse = np.linalg.pinv(upper)
    a = inverse @ lower
    rest = lower - upper @ a
    gram = inverse @ inverse.T
    moved_a = inverse @ (moved[:, s:] - moved[:, :-s] @ a) + gram @ (np.swapaxes(moved[:, :-s], 1, 2) @ rest)
    return _of_state_matrix(order, a, moved_a, basis[:s], moved[:, :s], seen.step_s)


def _moved_basis(model: CovarianceModel, order: int) -> Reals:
    """(b, rows, n) first-order movements of the leading left singular vectors out of their own span.

    Movements inside the span change the coordinates of the states and no mode.
    """
    u, s = model.left, model.singular_values
    columns, rows, outside = model.images
    ahead, behind = s[None, :order], s[order:, None]
    gap = ahead**2 - behind**2
    turned = (ahead * columns[:, order:, :order] + behind * np.swapaxes(rows[:, :order, order:], 1, 2)) / gap
    return np.asarray(u[:, order:] @ turned + outside[:, :, :order] / s[:order])


def _of_state_matrix(order: int, a: Reals, moved_a: Reals, c: Reals, moved_c: Reals, step_s: float) -> PoleScatter:
    discrete, right = np.linalg.eig(a)
    left = np.linalg.inv(right)
    coupled = left @ moved_a @ right
    keep = np.flatnonzero(discrete.imag > 1e-12 * np.abs(discrete))
    keep = keep[np.argsort(np.abs(np.log(discrete[keep])))]
    gaps = discrete[None, :] - discrete[:, None]
    np.fill_diagonal(gaps, np.inf)
    turned = right @ (coupled / gaps)[:, :, keep]
    poles = np.diagonal(coupled, axis1=1, axis2=2)[:, keep] / (discrete[keep] * step_s)
    shapes = c @ turned + moved_c @ right[:, keep]
    all_poles = Poles(order, np.log(discrete[keep]) / step_s, c @ right[:, keep])
    return PoleScatter(all_poles, np.asarray(poles), np.asarray(shapes))
