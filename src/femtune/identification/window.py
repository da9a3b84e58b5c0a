"""Functions that were made with an exponential window, and their poles.

The window e^{−t/τ} on forces and responses moves s = iω to σ + iω with σ = 1/τ: the measured functions are those of the
structure at this s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.identification.state_space_fit import SystemFit
from femtune.modal import FrfSet, StateSpace
from femtune.modal.frf_set import KINDS


def without_window(frfs: FrfSet, decay: float) -> FrfSet:
    """Functions (iω)^d Σ R/(iω + σ − λ) of those with an exponential window, (iω + σ)^d Σ R/(iω + σ − λ).

    They are a sum of modes again, with poles λ − σ and the same residues.

    Parameters
    ----------
    decay : σ in rad/s; the functions stay with 0
    """
    return replace(frfs, values=frfs.values * window_factor(frfs.freq_hz, frfs.kind, decay)) if decay else frfs


def window_factor(freq_hz: Reals, kind: str, decay: float) -> Complexes:
    """(k,) what this multiplies functions of a kind by, (iω/(iω + σ))^d with d = 0, 1, 2 for receptance, mobility,
    accelerance."""
    if not decay:
        return np.ones(len(freq_hz), complex)
    i_omega = 2j * np.pi * freq_hz
    return np.asarray((i_omega / (i_omega + decay)) ** KINDS.index(kind))


def with_window(system: StateSpace, decay: float) -> StateSpace:
    """The system whose functions at iω are those of the given one at σ + iω."""
    return replace(system, A=system.A - decay * np.eye(len(system.A)))


def fit_with_window(found: SystemFit, decay: float) -> SystemFit:
    """The fit whose system and poles are those of `with_window`."""
    return replace(found, system=with_window(found.system, decay), poles=found.poles - decay) if decay else found
