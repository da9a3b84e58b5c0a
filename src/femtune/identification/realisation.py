"""State matrices of all orders from one factorised block Hankel matrix, and the modes of each order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.linalg import eigh

from femtune.arrays import Complexes, Reals


@dataclass(frozen=True, eq=False)
class Poles:
    """Oscillating poles of one model order.

    Parameters
    ----------
    order : number of states
    poles : (m,) λ = −ζω ± iω√(1−ζ²) of the upper half plane in rad/s, by frequency
    shapes : (s, m) complex shapes at the channels
    """

    order: int
    poles: Complexes
    shapes: Complexes

    @property
    def freq_hz(self) -> Reals:
        """(m,) undamped natural frequencies."""
        return np.asarray(np.abs(self.poles) / (2.0 * np.pi))

    @property
    def damping_ratio(self) -> Reals:
        """(m,) fractions of critical; negative where a pole is unstable."""
        return np.asarray(-self.poles.real / np.abs(self.poles))


@dataclass(frozen=True, eq=False)
class Observability:
    """Column space of the future of a record: O (p·s, n) in the balanced basis, ordered by singular value.

    Parameters
    ----------
    matrix : O, for the largest order
    channels : s
    step_s : sampling interval
    """

    matrix: Reals
    channels: int
    step_s: float

    def state_matrices(self, orders: Iterable[int]) -> Iterator[tuple[int, Reals, Reals]]:
        """Order, A (n, n) and C (s, n) by the shift invariance of O; one QR serves all orders.

        Source: M. Döhler, L. Mevel, Mechanical Systems and Signal Processing 26 (2012), fast multi-order computation.
        """
        s = self.channels
        q, r = np.linalg.qr(self.matrix[:-s])
        turned = q.T @ self.matrix[s:]
        for n in orders:
            yield n, np.linalg.solve(r[:n, :n], turned[:n, :n]), self.matrix[:s, :n]

    def poles(self, orders: Iterable[int]) -> Iterator[Poles]:
        """Poles of each order."""
        for n, a, c in self.state_matrices(orders):
            yield modes_of(n, a, c, self.step_s)


def modes_of(order: int, a: Reals, c: Reals, step_s: float) -> Poles:
    """Poles of a discrete state matrix and shapes C v, one of each conjugate pair; real poles are no vibrations."""
    discrete, vectors = np.linalg.eig(a)
    keep = discrete.imag > 1e-12 * np.abs(discrete)
    continuous = np.log(discrete[keep]) / step_s
    by_frequency = np.argsort(np.abs(continuous))
    return Poles(order, continuous[by_frequency], (c @ vectors[:, keep])[:, by_frequency])


# ----------------------------------------------------------------------------------------------------
# Block Hankel matrices of correlation functions, their covariance, and suitable sizes for a record.


def block_hankel(functions: Reals, rows: int, columns: int, first: int = 1) -> Reals:
    """(rows·s, columns·r) with block (i, j) = functions[:, :, first + i + j].

    Parameters
    ----------
    functions : (s, r, lags + 1) correlation functions or free decays
    rows, columns : blocks; first + rows + columns − 2 may not exceed the lags
    """
    s, r, _ = functions.shape
    window = np.lib.stride_tricks.sliding_window_view(functions[:, :, first : first + rows + columns - 1], columns, 2)
    return np.asarray(window.transpose(2, 0, 3, 1).reshape(rows * s, columns * r))


# ----------------------------------------------------------------------------------------------------
# Eigensystem realisation algorithm (Juang and Pappa 1985) on free decays or on correlation functions.


def era(decays: Reals, step_s: float, rows: int, columns: int, order: int) -> Observability:
    """Observability matrix U√S of the block Hankel matrix of free decays; its shift gives A for all orders.

    Parameters
    ----------
    decays : (s, r, k) impulse responses or correlation functions of s channels to r references; k > rows + columns
    rows, columns : blocks of the Hankel matrix
    order : largest model order
    """
    u, s = _leading(block_hankel(decays, rows + 1, columns), order)
    return Observability(u * np.sqrt(s), decays.shape[0], step_s)


LARGE = 400
"""Rows and columns of a Hankel matrix from which only its leading singular values are computed."""
LEAST_SQUARED = 1e-10
"""Square of the smallest leading singular value beside that of the largest; smaller ones the squares do not show."""


def _leading(matrix: Reals, order: int) -> tuple[Reals, Reals]:
    """(rows, order) and (order,) leading left singular vectors and values; by the squares where these show all."""
    k = min(matrix.shape)
    if k > max(LARGE, 3 * order):
        wide = matrix.shape[0] <= matrix.shape[1]
        square = matrix @ matrix.T if wide else matrix.T @ matrix
        values, vectors = eigh(square, subset_by_index=(k - order, k - 1), check_finite=False)
        if values[0] > LEAST_SQUARED * values[-1]:
            s = np.sqrt(values[::-1])
            vectors = vectors[:, ::-1]
            return np.asarray(vectors if wide else matrix @ (vectors / s)), s
    u, s, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(u[:, :order]), s[:order]


# ----------------------------------------------------------------------------------------------------
# Correlation functions of ambient responses, which decay as free vibrations do (James, Carne and Lauffer 1993).


def correlations(values: Reals, references: Sequence[int], lags: int) -> Reals:
    """R[i, j, k] = mean of y_i(t + k) y_j(t), (s, r, lags + 1), unbiased.

    Parameters
    ----------
    values : (s, n) responses, mean taken off
    references : the r channels j
    lags : largest k, below n
    """
    s, n = values.shape
    size = fft.next_fast_len(n + lags + 1, real=True)
    spectra = fft.rfft(values, size)
    out = np.empty((s, len(references), lags + 1))
    for b, j in enumerate(references):
        out[:, b] = fft.irfft(spectra * spectra[j].conj(), size)[:, : lags + 1]
    return np.asarray(out / (n - np.arange(lags + 1)))


def correlations_by_block(values: Reals, references: Sequence[int], lags: int, blocks: int) -> Reals:
    """(blocks, s, r, lags + 1) correlations of consecutive pieces of a record, whose covariance is that of their mean.

    Each piece reaches `lags` samples into the next one, so that no product of samples is lost between them.
    """
    size = (values.shape[1] - lags) // blocks
    pieces = (values[:, b * size : (b + 1) * size + lags] for b in range(blocks))
    return np.stack([_piece(piece, references, lags, size) for piece in pieces])


def _piece(piece: Reals, references: Sequence[int], lags: int, size: int) -> Reals:
    """Products of references in the first `size` samples with all channels up to `lags` later."""
    s, length = piece.shape
    n = fft.next_fast_len(length + size, real=True)
    spectra, first = fft.rfft(piece, n), fft.rfft(piece[list(references), :size], n)
    out = np.empty((s, len(references), lags + 1))
    for b in range(len(references)):
        out[:, b] = fft.irfft(spectra * first[b].conj(), n)[:, : lags + 1]
    return np.asarray(out / size)
