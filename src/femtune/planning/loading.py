"""Changes of the structure by the test itself: masses of the sensors, and springs of a suspension."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.arrays import Integers, Reals


def rayleigh_with_masses(eigenvalues: Reals, masses: Reals, motion: Reals) -> Reals:
    """(m,) λ/(1 + Σ m_s|φ_s|²): Rayleigh quotients of mass-normalised modes with point masses.

    Parameters
    ----------
    eigenvalues : (m,)
    masses : (s,)
    motion : (s, 3, m) mass-normalised shapes at the masses
    """
    return np.asarray(eigenvalues / (1.0 + np.einsum("s,sim->m", masses, motion**2)))


@dataclass(frozen=True, eq=False)
class Suspended:
    """Modes on soft springs.

    Parameters
    ----------
    rigid : (r,) eigenvalues of the motions that are rigid-body modes without springs, ascending
    elastic : (m − r,) those of the elastic modes, in their order without springs
    """

    rigid: Reals
    elastic: Reals


def suspended(eigenvalues: Reals, rigid: int, springs: Reals, motion: Reals) -> Suspended:
    """The eigenvalues on springs, in the space of the modes without springs.

    Parameters
    ----------
    eigenvalues : (m,) λ without springs, those of the `rigid` rigid-body modes first
    springs : (s, 3) stiffness of each spring along the basic axes
    motion : (s, 3, m) mass-normalised shapes at the springs
    """
    B = (np.sqrt(springs)[:, :, None] * motion).reshape(-1, len(eigenvalues))
    free = np.where(np.arange(len(eigenvalues)) < rigid, 0.0, eigenvalues)
    values, vectors = la.eigh(np.diag(free) + B.T @ B)
    # the motions in which rigid-body modes prevail are those of the suspension
    share = (vectors[:rigid] ** 2).sum(axis=0)
    rigid_modes = np.sort(np.argsort(-share, kind="stable")[:rigid])
    others = np.setdiff1d(np.arange(len(values)), rigid_modes)
    return Suspended(values[rigid_modes], values[others][_order(vectors[rigid:, others])])


def _order(vectors: Reals) -> Integers:
    """Position of the suspended mode for each elastic mode."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415  a second to import, and few plans need it

    rows, columns = linear_sum_assignment(-(vectors**2))
    return np.asarray(columns[np.argsort(rows)])
