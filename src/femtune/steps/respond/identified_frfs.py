"""FRFs of the modes identified in a test, fitted to the measured FRFs of the same test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.identification.modal_solve import modal_basis, real_rows
from femtune.modal import pole_of

if TYPE_CHECKING:
    from femtune.arrays import Complexes, Reals
    from femtune.modal import FrfSet, ModeSet

_BAND_MARGIN = 0.1
"""Margin of the band beyond the lowest and highest identified frequency, relative to these.

Further away no identified mode describes the functions.
"""


def identified_frfs(frfs: FrfSet, modes: ModeSet | None) -> tuple[Reals, Complexes] | None:
    """FRFs with the frequencies and damping ratios of identified modes.

    The residues, and terms for the modes below and above, are fitted to each measured function by linear least squares.

    Parameters
    ----------
    frfs : (n, u) measured functions
    modes : of the same test; those without a damping ratio are left out

    Returns
    -------
    lines (k,) in Hz, from 10 % below the lowest mode to 10 % above the highest, and values (n, u, k), NaN for functions
        that have gaps there; None without such modes, and where the lines are too few
    """
    poles, (low, high) = _poles(modes)
    lines = np.flatnonzero((frfs.freq_hz > 0.0) & (frfs.freq_hz >= low) & (frfs.freq_hz <= high))
    complete = np.isfinite(frfs.values[:, :, lines]).all(axis=2)
    # two real unknowns a mode and one each of the two terms, two real equations a line
    if not len(poles) or len(lines) <= len(poles) + 1 or not complete.any():
        return None
    basis = modal_basis(frfs.freq_hz[lines], poles, frfs.kind).columns
    basis = basis / np.linalg.norm(basis, axis=0)
    measured = frfs.values[:, :, lines][complete].T
    values = np.full((*complete.shape, len(lines)), complex(np.nan, np.nan))
    values[complete] = (basis @ np.linalg.lstsq(real_rows(basis), real_rows(measured), rcond=None)[0]).T
    return frfs.freq_hz[lines], values


def _poles(modes: ModeSet | None) -> tuple[Complexes, tuple[float, float]]:
    """Those of the modes with a damping ratio, and the band that they describe."""
    if modes is None or modes.damping_ratio is None:
        return np.zeros(0, complex), (np.inf, 0.0)
    zeta = modes.damping_ratio
    known = (zeta > 0.0) & (zeta < 1.0) & (modes.freq_hz > 0.0)
    hz = modes.freq_hz[known]
    ends = (1.0 - _BAND_MARGIN) * hz.min(initial=np.inf), (1.0 + _BAND_MARGIN) * hz.max(initial=0.0)
    return pole_of(hz, zeta[known]), ends
