"""Eigensystem realisation algorithm (Juang and Pappa 1985) on free decays or on correlation functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.identify.hankel import block_hankel
from femtune.identify.realisation import Observability

Reals = NDArray[np.float64]


def era(decays: Reals, step_s: float, rows: int, columns: int, order: int) -> Observability:
    """Observability matrix U√S of the block Hankel matrix of free decays; its shift gives A for all orders.

    Parameters
    ----------
    decays : (s, r, k) impulse responses or correlation functions of s channels to r references; k > rows + columns
    rows, columns : blocks of the Hankel matrix
    order : largest model order
    """
    u, s, _ = np.linalg.svd(block_hankel(decays, rows + 1, columns), full_matrices=False)
    return Observability(u[:, :order] * np.sqrt(s[:order]), decays.shape[0], step_s)
