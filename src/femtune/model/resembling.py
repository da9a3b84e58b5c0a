"""Frequencies of a changed model from the modes of the unchanged one."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.modal.assignment import linear_sum_assignment

_LEAST_LIKENESS = 0.5
"""Squared cosine of a shape and the Ritz vectors of one frequency from which on they are the same mode: only one
frequency can exceed it."""
_EQUAL = 0.01
"""Relative difference of eigenvalues that count as equal where shapes are matched: half a per cent of frequency."""
_TIE_BREAK = 1e-3
"""Weight of a single shape if those of several nearly equal frequencies are equally similar."""


def resembling_hz(shapes: Reals, basis: Reals, stiffness: Any, mass: Any) -> Reals:
    """(m,) frequencies of the Ritz vectors that resemble some shapes; NaN where none does. Modes may change places.

    Parameters
    ----------
    shapes : (n, m) of the unchanged model
    basis : (n, r) independent vectors whose span has the modes of the changed model
    stiffness, mass : (n, n) of the changed model, with the operator @
    """
    heavy, stiff = mass @ basis, basis.T @ (stiffness @ basis)
    across = basis.T @ heavy
    values, vectors = la.eigh(0.5 * (stiff + stiff.T), 0.5 * (across + across.T))
    modal_mass = np.einsum("ij,ij->j", shapes, mass @ shapes)
    single = ((shapes.T @ heavy) @ vectors) ** 2 / modal_mass[:, None]
    # shapes of equal frequencies are any basis of their span: each counts with those of nearly the same frequency
    near = np.abs(values[:, None] - values) <= _EQUAL * np.abs(values)
    likeness = single @ near
    rows, columns = linear_sum_assignment(likeness + _TIE_BREAK * single, maximize=True)
    out = np.full(shapes.shape[1], np.nan)
    good = likeness[rows, columns] >= _LEAST_LIKENESS
    out[rows[good]] = np.sqrt(np.maximum(values[columns[good]], 0.0)) / (2.0 * np.pi)
    return out
