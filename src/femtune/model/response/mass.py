"""Mass properties as responses: total mass, centre of gravity and inertia, with derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Reals
from femtune.fem.checks import MassProperties, mass_properties_of, rigid_body_modes
from femtune.fem.elements.placement import arm_transform
from femtune.fem.values import TableJet
from femtune.model.configuration import mass_terms
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.terms import MatrixTerm, Term, TermFunction


@dataclass(frozen=True, eq=False)
class MassResponse:
    """Mass properties in the basic frame and their derivatives by p normalised free parameters.

    Parameters
    ----------
    properties : values, with the point `about` that the inertia refers to
    mass : (p,) derivative of the mean of the masses felt in the three directions
    centre : (3, p) derivative of the centre of gravity
    inertia : (3, 3, p) derivative of the inertia tensor about the point
    matrix : (6, 6, p) derivative of the rigid-body mass matrix about the point
    """

    properties: MassProperties
    mass: NDArray
    centre: NDArray
    inertia: NDArray
    matrix: NDArray
    parameters: tuple[str, ...]


def mass_response(point: ModelPoint, about: ArrayLike = (0.0, 0.0, 0.0)) -> MassResponse:
    """Mass properties of all that is active in the configuration, masses at supports included."""
    reference = np.asarray(about, dtype=float)
    value, gradient = _rigid_mass(point, reference)
    names = tuple(p.name for p in point.configured.model.parameters.free)
    return MassResponse(
        mass_properties_of(value, reference), np.trace(gradient[:3, :3]) / 3.0, _centre_gradient(value, gradient),
        gradient[3:, 3:], gradient, names,
    )  # fmt: skip


def _rigid_mass(point: ModelPoint, about: NDArray) -> tuple[NDArray, NDArray]:
    """(6, 6) mass matrix of the six rigid motions about a point, and its derivatives (6, 6, p)."""
    configured = point.configured
    structure, off = configured.model.structure, list(configured.configuration.elements_off)
    motions = np.vstack([rigid_body_modes(structure.nodes, about), np.zeros((1, 6))])
    table = configured.model.table(point.x)
    value, gradient = np.zeros((6, 6)), np.zeros((6, 6, point.n_parameters))
    for term in (*configured.model.kept.mass, *mass_terms(structure.nodes, configured.configuration.masses)):
        more, slopes = _of_term(term, _rigid_parts(term, motions, off), table)
        value, gradient = value + more, gradient + slopes
    return value, gradient


def _rigid_parts(term: TermFunction, motions: NDArray, off: list[int]) -> NDArray:
    """(n_columns, 6, 6) rᵀMr of every column of a term."""
    out = np.zeros((term.n_columns, 6, 6))
    if isinstance(term, MatrixTerm):
        half = motions[:-1].T @ (term.upper @ motions[:-1])
        return np.asarray((half + half.T - motions[:-1].T @ (term.upper.diagonal()[:, None] * motions[:-1]))[None])
    assert isinstance(term, Term)
    for part in term.parts():
        active = ~np.isin(term.elements[part], off)
        moved = motions[term.dofs[part][active]]
        matrices = np.swapaxes(moved, 1, 2) @ (term.matrices(part)[active] @ moved)
        np.add.at(out, term.columns[part][active], matrices)
    return out


def _of_term(term: TermFunction, parts: NDArray, table: TableJet) -> tuple[NDArray, NDArray]:
    if term.coefficient is None:
        return parts.sum(axis=0), np.zeros((6, 6, 1))
    c = term.coefficient(table)
    return np.einsum("eab,e->ab", parts, c.value), np.einsum("eab,ep->abp", parts, c.grad)


def _centre_gradient(matrix: NDArray, gradient: NDArray) -> NDArray:
    """(3, p): each coordinate is a static moment over the two masses across its axis."""
    out = np.zeros((3, gradient.shape[-1]), dtype=gradient.dtype)
    for axis in range(3):
        j, k = (axis + 1) % 3, (axis + 2) % 3
        moment, mass = matrix[j, 3 + k] - matrix[k, 3 + j], matrix[j, j] + matrix[k, k]
        slope = gradient[j, 3 + k] - gradient[k, 3 + j]
        if mass:
            out[axis] = slope / mass - moment / mass**2 * (gradient[j, j] + gradient[k, k])
    return out


# ----------------------------------------------------------------------------------------------------
# Modal effective mass: how much of the structure's mass a mode moves when the supports move as a rigid body.


_NO_INERTIA = 1e-9
"""Inertia relative to mass·(largest distance)² that is zero except for rounding: that of points on a line about it."""


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

    M is that of all grid points: the coupling of supports with free DOFs by a consistent mass is included. Over all
    modes the sum is the structure's mass, less what sits on the supports.

    Source: Wijker, Mechanical Vibrations in Spacecraft Design, Springer 2004, on modal effective mass.
    """
    point = modes.point
    nodes = point.configured.model.structure.nodes
    motions = rigid_body_modes(nodes)
    forces = inertial_forces(point, motions)
    about = mass_properties_of(motions.T @ forces, np.zeros(3))
    # the six motions about the centre are combinations of those about the origin
    move = arm_transform(np.eye(3)[None], -about.centre[None], np.eye(3)[None])[0]
    total = np.diag(move.T @ about.matrix @ move).copy()
    total[total <= _least(total, nodes.xyz - about.centre)] = 0.0
    moved = modes.point.configured.transformation @ modes.shapes[:, : modes.wanted]
    return EffectiveMass(about.centre, total, (moved.T @ forces @ move) ** 2)


def _least(total: Reals, arms: Reals) -> Reals:
    """(6,) mass and inertia that count as zero."""
    mass = float(total[:3].max(initial=0.0))
    reach = float((arms**2).sum(axis=1).max(initial=0.0))
    return _NO_INERTIA * mass * np.repeat([1.0, reach], 3)


def inertial_forces(point: ModelPoint, motions: Reals) -> Reals:
    """(n_g, 6) M_g r at the parameters of the point, before any constraint."""
    configured = point.configured
    structure, off = configured.model.structure, list(configured.configuration.elements_off)
    table = configured.model.table(point.x)
    # one row more stands for the ground
    grounded, out = np.vstack([motions, np.zeros((1, 6))]), np.zeros((len(motions) + 1, 6))
    for term in (*configured.model.kept.mass, *mass_terms(structure.nodes, configured.configuration.masses)):
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
