"""The part of rigid-body motion in functions of a free structure: taken away before identification, put back after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal import FrfSet, ModeSet, StateSpace
from femtune.modal.frf_set import KINDS


def without_rigid_body(frfs: FrfSet, rigid: ModeSet, decay: float = 0.0) -> FrfSet:
    """The functions less `rigid_body_motion` at their lines; arguments and errors as there."""
    return replace(frfs, values=frfs.values - rigid_body_motion(rigid, frfs, frfs.freq_hz, decay))


def rigid_body_motion(rigid: ModeSet, of: FrfSet, freq_hz: Reals, decay: float = 0.0) -> Complexes:
    """(n, u, k) Σ φφᵀ s^{d−2} at s = σ + iω, d being 0, 1, 2 for receptance, mobility, accelerance.

    Parameters
    ----------
    rigid : mass-normalised rigid-body modes of the free structure, as a model has them, at all responses and references
    of : functions with these responses and references, and their kind
    freq_hz : (k,) lines
    decay : σ in rad/s

    Raises
    ------
    FemtuneError : ``identify.rigid-modes`` where they are not mass-normalised, ``dof.missing``
    """
    out, into = _ends(rigid, of)
    s = decay + 2j * np.pi * freq_hz
    factor = np.where(s == 0.0, np.nan, s) ** (KINDS.index(of.kind) - 2)
    factor = np.ones_like(s) if of.kind == "accelerance" else factor
    return np.asarray((out @ into.T)[:, :, None] * factor)


def with_rigid_body(system: StateSpace, rigid: ModeSet) -> StateSpace:
    """The system with rigid-body motion: a direct term of accelerance, one integrator a mode of mobility, else two.

    Raises
    ------
    FemtuneError : ``identify.rigid-modes``, ``dof.missing``
    """
    out, into = _ends(rigid, system)
    if system.kind == "accelerance":
        return replace(system, D=system.D + out @ into.T)
    r = out.shape[1]
    once = system.kind == "mobility"
    A = np.zeros((r, r)) if once else np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(r))
    B = into.T if once else np.vstack([np.zeros_like(into.T), into.T])
    C = out if once else np.hstack([out, np.zeros_like(out)])
    return replace(system, A=block_diag(system.A, A), B=np.vstack([system.B, B]), C=np.hstack([system.C, C]))


def _ends(rigid: ModeSet, of: FrfSet | StateSpace) -> tuple[Reals, Reals]:
    if rigid.normalisation != "mass" or np.iscomplexobj(rigid.shapes):
        raise FemtuneError("identify.rigid-modes", normalisation=rigid.normalisation)
    return rigid.select_dofs(of.responses).shapes, rigid.select_dofs(of.references).shapes
