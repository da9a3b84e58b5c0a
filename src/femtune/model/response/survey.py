"""FRFs for a survey: those of the modal methods except for the last digits, at a fraction of their cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from femtune.arrays import Complexes, Reals
from femtune.modal.kinds import FrfKind
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.kinds import FrfMethod
from femtune.model.response.basis import modal_basis, shifted_basis
from femtune.model.response.frf_methods import checked_request, direct_fields, superposed
from femtune.model.response.gradient import system_of_modes
from femtune.model.response.modal_damping import DampingRatios
from femtune.model.response.ports import Ports
from femtune.model.response.reduced import fields, reduce


def survey_functions(
    model: ModelPoint | EigenSolution,
    ports: Ports,
    freq_hz: ArrayLike,
    kind: FrfKind = "accelerance",
    method: FrfMethod = "real-modes",
    *,
    damping: DampingRatios | None = None,
    residual_vectors: bool = True,
    left_out: Sequence[int] = (),
    decay: float = 0.0,
) -> Complexes:
    """(outputs, inputs, k) FRFs to look at, not to compare: which are zero, which have the wrong sign or size.

    Real modes and the responses to the inputs and to unit forces at the outputs at the shift of the solution: one
    solution a force. A function that is zero in the model is zero here.

    Parameters
    ----------
    model, ports, freq_hz, kind, method, damping, residual_vectors, left_out, decay : as of `frf_gradient`

    Raises
    ------
    FemtuneError : as `frf`
    """
    request = checked_request(model, ports, freq_hz, kind, method, damping, decay)
    if method == "direct":
        B, points = ports.inputs.toarray(), map(complex, request.s)
        receptance = np.array([ports.outputs @ direct_fields(request.stiffness_at(s), s, B) for s in points])
    else:
        assert request.modes is not None
        forces = _distinct(sp.csc_array(sp.hstack([ports.inputs, ports.outputs.T], format="csc")))
        basis = shifted_basis(request.modes, forces) if residual_vectors else modal_basis(request.modes, None)
        reduced = reduce(request.stiffness, basis, ports)
        receptance = reduced.outputs @ fields(reduced, request.s, reduced.inputs)
    if left_out:
        receptance = receptance - superposed(request, system_of_modes(request, left_out), None)
    return np.asarray(np.moveaxis(receptance * request.factor[:, None, None], 0, -1))


def _distinct(forces: sp.csc_array) -> Reals:
    """(n_free, k) dense, each column once: the response to a force serves where it acts and where motion is seen."""
    forces.sort_indices()
    places = zip(forces.indptr[:-1], forces.indptr[1:])
    first = {(forces.indices[a:b].tobytes(), forces.data[a:b].tobytes()): k for k, (a, b) in enumerate(places)}
    return np.asarray(forces[:, sorted(first.values())].toarray())
