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
_DEPENDENT = 1e-10
"""Product of a combination of unit vectors with itself, relative to the largest, below which they are dependent."""
_TIE_BREAK = 1e-3
"""Weight of a single shape if those of several nearly equal frequencies are equally similar."""


def resembling_hz(shapes: Reals, basis: Reals, stiffness: Any, mass: Any) -> Reals:
    """(m,) frequencies of the Ritz vectors that resemble some shapes; NaN where none does. Modes may change places.

    Parameters
    ----------
    shapes : (n, m) of the unchanged model
    basis : (n, r) vectors whose span has the modes of the changed model
    stiffness, mass : (n, n) of the changed model, with the operator @
    """
    heavy, stiff = mass @ basis, basis.T @ (stiffness @ basis)
    across = basis.T @ heavy
    stiff, across = 0.5 * (stiff + stiff.T), 0.5 * (across + across.T)
    try:
        values, vectors = la.eigh(stiff, across)
    except la.LinAlgError:
        # of few degrees of freedom the vectors are not independent
        span = _independent(across)
        values, vectors = la.eigh(span.T @ stiff @ span)
        vectors = span @ vectors
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


def _independent(products: Reals) -> Reals:
    """(r, q) combinations of vectors that are orthonormal, from the products (r, r) of all vectors."""
    size = np.sqrt(np.maximum(np.diag(products), 0.0))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
    values, vectors = la.eigh(scale[:, None] * products * scale)
    kept = values > _DEPENDENT * values[-1]
    return np.asarray(scale[:, None] * vectors[:, kept] / np.sqrt(values[kept]))
