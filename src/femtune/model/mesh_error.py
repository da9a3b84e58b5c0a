"""Errors that updating cannot correct: of the mesh, by one refinement, and lumped versus consistent mass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Reals
from femtune.fem.refine import CannotRefineError, refine
from femtune.modal.assignment import linear_sum_assignment
from femtune.modal.shape_criteria import mac_where_defined
from femtune.model.configuration import held_dofs
from femtune.model.configured import configure, grid_matrix
from femtune.model.eigen.solution import EigenSolution, solve_modes
from femtune.model.parametric import parametric_model
from femtune.parameters import ParameterSet

MOST_DOFS = 300_000
"""Models of more grid DOFs are not looked at, nor those that the refinement would make larger."""
RICHARDSON = 4.0 / 3.0
"""Error over change for convergence of second order in the size of the elements, which linear shells have."""
_SAME = 0.5


@dataclass(frozen=True)
class MeshChange:
    """Frequencies before and after one refinement.

    Parameters
    ----------
    freq_hz, refined_hz : (m,) of the modes and of the refined mesh's modes of the same shape, NaN where none resembles
    free_dofs : of the refined model
    """

    freq_hz: Reals
    refined_hz: Reals
    free_dofs: int

    @property
    def error(self) -> Reals:
        """(m,) estimated relative error of each frequency; NaN for rigid-body modes and where no shape was found."""
        with np.errstate(divide="ignore", invalid="ignore"):
            change = self.freq_hz / self.refined_hz - 1.0
        return np.asarray(RICHARDSON * change)


def mesh_change(solution: EigenSolution) -> MeshChange | str:
    """Solve the refined mesh at the deck's values and compare with these modes; a reason in words where it cannot be.

    Source: Richardson (1911) extrapolation; modes are matched by their MAC at the old grid points.
    """
    configured = solution.point.configured
    structure, configuration = configured.model.structure, configured.configuration
    try:
        finer = refine(structure, held_dofs(structure, configuration), configuration.elements_off)
    except CannotRefineError as reason:
        return str(reason)
    if finer.nodes.n_dofs > MOST_DOFS:
        return f"the refined model would have {finer.nodes.n_dofs} DOFs, more than {MOST_DOFS}"
    model = parametric_model(finer, ParameterSet(()), ())
    there = configure(model, replace(configuration, elements_off=frozenset()))
    wanted = solution.wanted
    found = solve_modes(there.at(np.zeros(0)), wanted + 4)
    old = configured.transformation @ solution.shapes[:, :wanted]
    new = (there.transformation @ found.shapes[:, : found.wanted])[: len(old)]
    return MeshChange(_elastic(solution.freq_hz), _matched(old, new, found.freq_hz), there.n_free)


def _elastic(freq_hz: Reals) -> Reals:
    """NaN for rigid-body modes."""
    return np.where(freq_hz > 1e-3 * freq_hz.max(initial=0.0), freq_hz, np.nan)


def _matched(old: Reals, new: Reals, freq_hz: Reals) -> Reals:
    likeness = np.nan_to_num(mac_where_defined(old, new))
    rows, columns = linear_sum_assignment(likeness, maximize=True)
    out = np.full(old.shape[1], np.nan)
    good = likeness[rows, columns] >= _SAME
    out[rows[good]] = freq_hz[columns[good]]
    return out


def mass_change(solution: EigenSolution) -> Reals | str:
    """(m,) relative change of each frequency where lumped mass takes the place of consistent mass, or the reverse.

    To first order in the difference of the matrices, by the Rayleigh quotient: f′/f = (1 + φᵀ(M′ − M)φ)^-½ with φ of
    unit modal mass. NaN for rigid-body modes.
    """
    configured = solution.point.configured
    structure, configuration = configured.model.structure, configured.configuration
    if not structure.batches:
        return "the model consists of imported matrices"
    if structure.nodes.n_dofs > MOST_DOFS:
        return f"the model has {structure.nodes.n_dofs} DOFs, more than {MOST_DOFS}"
    other = replace(structure, consistent_mass=not structure.consistent_mass)
    models = (parametric_model(s, ParameterSet(()), ()) for s in (structure, other))
    own, changed = (grid_matrix(model, configuration, "mass") for model in models)
    shapes = configured.transformation @ solution.shapes[:, : solution.wanted]
    share = np.einsum("ij,ij->j", shapes, (changed - own) @ shapes)
    return np.where(np.isnan(_elastic(solution.freq_hz)), np.nan, 1.0 / np.sqrt(1.0 + share) - 1.0)
