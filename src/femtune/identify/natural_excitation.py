"""Correlation functions of ambient responses, which decay as free vibrations do (James, Carne and Lauffer 1993)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Reals = NDArray[np.float64]


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
    """(blocks, s, r, lags + 1) correlations of consecutive pieces of a record, whose scatter is that of their mean.

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
