"""Modal effective mass: how much of the structure's mass a mode moves when the supports move as a rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.fem.checks import mass_properties_of, rigid_body_modes
from femtune.fem.elements.placement import arm_transform
from femtune.model.configuration import mass_terms
from femtune.model.configured import ModelPoint
from femtune.model.eigen import EigenSolution
from femtune.model.term import MatrixTerm, Term

Reals = NDArray[np.float64]

_NOTHING = 1e-9
"""Inertia below this part of mass·(largest distance)² is none: points on a line about that line."""


@dataclass(frozen=True, eq=False)
class EffectiveMass:
    """Effective masses of the wanted modes in the basic frame.

    Parameters
    ----------
    about : (3,) centre of gravity, which the rotations are about
    total : (6,) mass felt in X, Y, Z and inertia about the three axes, of the whole structure
    masses : (m, 6) effective mass, and inertia, of each mode
    """

    about: Reals
    total: Reals
    masses: Reals

    @property
    def fractions(self) -> Reals:
        """(m, 6) parts of the whole; NaN in directions without mass."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.total > 0.0, self.masses / self.total, np.nan)


def effective_mass(modes: EigenSolution) -> EffectiveMass:
    """(φᵀTᵀM r)² of each wanted mode and each rigid motion r, with φᵀTᵀMTφ = 1.

    M is that of all grid points: where a consistent mass couples supports with what is free, that counts. Over all
    modes the sum is the structure's mass, less what sits on the supports.

    Source: Wijker, Mechanical Vibrations in Spacecraft Design, Springer 2004, on modal effective mass.
    """
    point = modes.point
    nodes = point.configured.model.structure.nodes
    motions = rigid_body_modes(nodes)
    forces = _inertial_forces(point, motions)
    about = mass_properties_of(motions.T @ forces, np.zeros(3))
    # the six motions about the centre are combinations of those about the origin
    move = arm_transform(np.eye(3)[None], -about.centre[None], np.eye(3)[None])[0]
    total = np.diag(move.T @ about.matrix @ move).copy()
    total[total <= _least(total, nodes.xyz - about.centre)] = 0.0
    moved = modes.point.configured.transformation @ modes.shapes[:, : modes.wanted]
    return EffectiveMass(about.centre, total, (moved.T @ forces @ move) ** 2)


def _least(total: Reals, arms: Reals) -> Reals:
    """(6,) what counts as no mass, as no inertia."""
    mass = float(total[:3].max(initial=0.0))
    reach = float((arms**2).sum(axis=1).max(initial=0.0))
    return _NOTHING * mass * np.repeat([1.0, reach], 3)


def _inertial_forces(point: ModelPoint, motions: Reals) -> Reals:
    """(n_g, 6) M_g r at the parameters of the point, before any constraint."""
    configured = point.configured
    structure, off = configured.model.structure, list(configured.configuration.elements_off)
    table = configured.model.table(point.x)
    # one row more stands for the ground
    grounded, out = np.vstack([motions, np.zeros((1, 6))]), np.zeros((len(motions) + 1, 6))
    for term in (*configured.model.terms, *mass_terms(structure.nodes, configured.configuration.masses)):
        if term.matrix != "mass":
            continue
        c = np.ones(1) if term.coefficient is None else term.coefficient(table).value
        if isinstance(term, MatrixTerm):
            whole = term.upper @ motions + term.upper.T @ motions - term.upper.diagonal()[:, None] * motions
            out[:-1] += c[0] * whole
        elif isinstance(term, Term):
            for part in term.parts():
                on = ~np.isin(term.elements[part], off)
                at, factor = term.dofs[part][on], c[term.columns[part][on], None, None]
                np.add.at(out, at, factor * (term.matrices(part)[on] @ grounded[at]))
    return out[:-1]
