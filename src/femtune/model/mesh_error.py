"""Errors that updating cannot correct: of the mesh, by one refinement, and lumped versus consistent mass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.fem.elements import KINDS
from femtune.fem.refine import CannotRefineError, refine
from femtune.fem.structure import Structure
from femtune.model.configuration import held_dofs
from femtune.model.configured import configure, grid_matrix
from femtune.model.drilling import drilling_modes
from femtune.model.eigen.pencil import Pencil
from femtune.model.eigen.solution import EigenSolution
from femtune.model.linear.sparse_products import column_major
from femtune.model.parametric import parametric_model
from femtune.model.resembling import resembling_hz
from femtune.model.response.rigid import is_rigid
from femtune.model.solvers.interface import SingularMatrixError
from femtune.parameters import ParameterSet

MOST_DOFS = 300_000
"""Refined models with more DOFs are never solved, since their factors may not fit into the memory."""
USUAL_DOFS = 30_000
"""Refined models with more DOFs are solved on request only: up to here it takes one or two seconds."""
RICHARDSON = 4.0 / 3.0
"""Error over change for convergence of second order in the size of the elements, which linear shells have."""
_MOSTLY_DRILLING = 0.2
"""Share of drilling in the strain energy from which on a mode has no frequency of a converged mesh."""
_RIGID = 1e-3
"""Frequency relative to the highest one below which a mode counts as a rigid-body mode."""


@dataclass(frozen=True)
class MeshChange:
    """Frequencies before and after one refinement.

    Parameters
    ----------
    freq_hz, refined_hz : (m,) of the modes and of the refined mesh's modes of the same shape, NaN for rigid-body modes
        and where none resembles
    free_dofs : of the refined model
    whole : cards of surfaces that were not divided
    drilling : numbers of modes of drilling stiffness, which falls with the area of the elements: they converge to zero
        frequency, so that they have no refined frequency here
    """

    freq_hz: Reals
    refined_hz: Reals
    free_dofs: int
    whole: tuple[str, ...] = ()
    drilling: tuple[int, ...] = ()

    @property
    def error(self) -> Reals:
        """(m,) estimated relative error of each frequency; NaN for rigid-body modes and where no shape was found."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.freq_hz / self.refined_hz
            # the power is the same for small changes, and stays above −100 %
            return np.asarray(np.where(ratio < 1.0, ratio**RICHARDSON - 1.0, RICHARDSON * (ratio - 1.0)))

    @property
    def converged_hz(self) -> Reals:
        """(m,) frequencies to be expected of a converged mesh; NaN likewise."""
        return np.asarray(self.freq_hz / (1.0 + self.error))


def mesh_change(solution: EigenSolution, most_dofs: int = MOST_DOFS) -> MeshChange | str:
    """Modes of a mesh of half the size with the values of the solution; a reason in words if they cannot be computed.

    The shapes are interpolated to the refined mesh. One step of inverse iteration with all of them, including those
    beyond the wanted ones, takes what the coarse mesh could not represent into account; the Ritz values in their span
    are the frequencies of the refined mesh to second order in what is left. Ritz vectors are matched with the shapes
    that they came from, so that modes may change places.

    Parameters
    ----------
    most_dofs : largest number of DOFs of the refined model

    Source: Richardson (1911) extrapolation; inverse iteration as in subspace iteration, Bathe and Wilson (1972).
    """
    configured = solution.point.configured
    structure, configuration = solution.point.structure, configured.configuration
    most_dofs = min(most_dofs, MOST_DOFS)
    reason = too_large(structure, most_dofs)
    if reason:
        return reason
    if np.isnan(_elastic(solution)).all():
        return "no elastic mode was computed"
    try:
        finer = refine(structure, held_dofs(structure, configuration), configuration.elements_off)
    except CannotRefineError as reason:
        return str(reason)
    if finer.structure.nodes.n_dofs > most_dofs:
        return _beyond(str(finer.structure.nodes.n_dofs), most_dofs)
    try:
        model = parametric_model(finer.structure, ParameterSet(()), ())
        there = configure(model, replace(configuration, elements_off=frozenset()))
    except FemtuneError as error:
        return f"the refined model cannot be built ({error.code})"
    start = (finer.prolongation @ (configured.transformation @ solution.shapes))[there.free]
    point = there.at(np.zeros(0))
    try:
        refined = _refined_hz(Pencil(point.symmetric_stiffness, point.symmetric_mass), start, solution)
    except (SingularMatrixError, la.LinAlgError):
        return "the stiffness of the refined model is singular"
    drilling = tuple(mode.number for mode in drilling_modes(solution) if mode.share > _MOSTLY_DRILLING)
    refined[[number - 1 for number in drilling]] = np.nan
    return MeshChange(_elastic(solution), refined, there.n_free, finer.whole, drilling)


def too_large(structure: Structure, most_dofs: int) -> str:
    """The reason in words where the refined model is certain to have more DOFs than `most_dofs`; "" otherwise.

    Every element that is divided brings one grid point at least.
    """
    divided = sum(len(b) for b in structure.batches if KINDS[b.kind].children)
    least = structure.nodes.n_dofs + 6 * divided
    return _beyond(f"at least {least}", most_dofs) if least > most_dofs else ""


def _beyond(dofs: str, most: int) -> str:
    request = "; refinement = true in [checks] computes it" if most < MOST_DOFS else ""
    return f"the refined model would have {dofs} DOFs, more than {most}{request}"


def _refined_hz(pencil: Pencil, start: Reals, solution: EigenSolution) -> Reals:
    """(m,) frequencies of the wanted modes on the refined mesh from their interpolated shapes; NaN where none fits.

    A mode that moves nothing of the refined mesh, as of a mass without stiffness, has none.
    """
    first = column_major(start)
    step = pencil.factorise(_shift(solution)).solve(column_major(pencil.mass @ first))
    size = np.linalg.norm(step, axis=0)
    moving, out = size > 0.0, np.full(solution.wanted, np.nan)
    wanted = np.flatnonzero(moving[: solution.wanted])
    basis = column_major(step[:, moving] / size[moving])
    out[wanted] = resembling_hz(column_major(first[:, wanted]), basis, pencil.stiffness, pencil.mass)
    return out


def _shift(solution: EigenSolution) -> float:
    """Shift of the step of inverse iteration: no further from zero than the lowest elastic mode.

    The step leaves (λ − s) / (μ − s) of a component of eigenvalue μ in a mode of eigenvalue λ. The shift s of the
    solution belongs to the whole spectrum: in thin plates it is so far below the lowest modes that the step would leave
    most of the shear strains of interpolated shapes.
    """
    return max(solution.shift, -float((2.0 * np.pi * np.nanmin(_elastic(solution))) ** 2))


def _elastic(solution: EigenSolution) -> Reals:
    """(m,) frequencies, NaN for rigid-body modes."""
    freq_hz = solution.freq_hz
    rigid = is_rigid(solution)[: solution.wanted] | (freq_hz <= _RIGID * freq_hz.max(initial=0.0))
    return np.where(rigid, np.nan, freq_hz)


def mass_change(solution: EigenSolution) -> Reals | str:
    """(m,) relative change of each frequency where lumped mass takes the place of consistent mass, or the reverse.

    To first order in the difference of the matrices, by the Rayleigh quotient: f′/f = (1 + φᵀ(M′ − M)φ)^-½ with φ of
    unit modal mass. NaN for rigid-body modes.
    """
    configured = solution.point.configured
    structure, configuration = solution.point.structure, configured.configuration
    if not structure.batches:
        return "the model consists of imported matrices"
    if structure.nodes.n_dofs > MOST_DOFS:
        return f"the model has {structure.nodes.n_dofs} DOFs, more than {MOST_DOFS}"
    other = replace(structure, consistent_mass=not structure.consistent_mass)
    models = (parametric_model(s, ParameterSet(()), ()) for s in (structure, other))
    present, changed = (grid_matrix(model, configuration, "mass") for model in models)
    shapes = configured.transformation @ solution.shapes[:, : solution.wanted]
    share = np.einsum("ij,ij->j", shapes, (changed - present) @ shapes)
    return np.where(np.isnan(_elastic(solution)), np.nan, 1.0 / np.sqrt(1.0 + share) - 1.0)
