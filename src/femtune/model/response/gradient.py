"""Derivatives of FRFs by the parameters: H′ = −C Z⁻¹ Z′ Z⁻¹ B from the response to inputs and to unit outputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.modal import FrfSet
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.frf_methods import (
    Kind,
    Method,
    Progress,
    Request,
    System,
    as_frf_set,
    checked_request,
    direct_fields,
    reduced_system,
)
from femtune.model.response.modal_damping import DampingRatios
from femtune.model.response.ports import Ports


@dataclass(frozen=True, eq=False)
class FrfGradient:
    """FRFs and their derivatives.

    Parameters
    ----------
    frfs : the functions themselves
    gradient : (outputs, inputs, k, p) derivatives by the normalised free parameters
    parameters : p names
    """

    frfs: FrfSet
    gradient: NDArray[np.complex128]
    parameters: tuple[str, ...]


def frf_gradient(
    model: ModelPoint | EigenSolution,
    ports: Ports,
    freq_hz: ArrayLike,
    kind: Kind = "accelerance",
    method: Method = "real-modes",
    *,
    damping: DampingRatios | None = None,
    residual_vectors: bool = True,
    derivatives: bool = True,
    progress: Progress | None = None,
) -> FrfGradient:
    """FRFs and their derivatives; arguments and errors as of `frf`.

    Without `derivatives` (gradients of no columns) the functions come from the same basis, which `frf` would make
    smaller, so that values of points with and without derivatives compare.

    "direct" is exact: one factorisation a line serves value and derivatives. The modal ways take the response to
    inputs and to unit forces at the outputs from the modes, and residual vectors for both; the derivative converges
    with the modes, as the functions do. Derivatives of modal damping are exact in the direct way (ζ goes with its
    mode; where it is a function of frequency, with the frequency).
    """
    request = checked_request(model, ports, freq_hz, kind, method, damping)
    count = request.stiffness.point.n_parameters if derivatives else 0
    if method == "direct":
        receptance, gradient = _direct(request, count, progress)
    else:
        outputs = request.ports.outputs.T.toarray()
        system = reduced_system(request, residual_vectors, outputs)
        receptance, gradient = _superposed(request, system, count)
    names = request.stiffness.point.configured.model.parameters.free[:count]
    scaled = np.moveaxis(gradient * request.factor[:, None, None, None], 0, 2)
    return FrfGradient(as_frf_set(request, receptance), scaled, tuple(p.name for p in names))


def _direct(request: Request, p: int, progress: Progress | None) -> tuple[NDArray, NDArray]:
    B, C = request.ports.inputs.toarray(), request.ports.outputs
    k, a, b = len(request.s), C.shape[0], B.shape[1]
    forces = np.hstack([B, C.T.toarray()]) if p else B
    values, gradient = np.empty((k, a, b), complex), np.empty((k, a, b, p), complex)
    for i, s in enumerate(map(complex, request.s)):
        stiffness = request.stiffness_at(s)
        both = direct_fields(stiffness, s, forces)
        values[i] = C @ both[:, :b]
        for j in range(p):
            gradient[i, :, :, j] = -stiffness.derivative_between(j, s, both[:, b:], both[:, :b])
        if progress is not None:
            progress(i + 1, k)
    return values, gradient


def _superposed(request: Request, system: System, count: int) -> tuple[NDArray, NDArray]:
    reduced, b = system.reduced, system.reduced.inputs.shape[1]
    q = system.respond(request.s, np.hstack([reduced.inputs, reduced.outputs.T]))
    x, y = q[:, :, :b], np.swapaxes(q[:, :, b:], 1, 2)
    derivatives = [
        -_between(projected_derivatives(request.stiffness, reduced.basis.vectors, j), request.s, y, x)
        for j in range(count)
    ]
    shape = (len(request.s), len(reduced.outputs), b, 0)
    return np.asarray(reduced.outputs @ x), np.stack(derivatives, axis=-1) if derivatives else np.zeros(shape)


def projected_derivatives(stiffness: DynamicStiffness, Q: NDArray, j: int) -> tuple[NDArray, NDArray, NDArray]:
    """QᵀM′Q, QᵀC′Q and Qᵀ(K′ + iH′)Q by parameter j, modal damping in the one where it belongs."""
    viscous = Q.T @ stiffness.viscous_derivative_times(j, Q)
    return Q.T @ (stiffness.point.mass_derivatives[j] @ Q), viscous, Q.T @ stiffness.stiffness_derivative_times(j, Q)


def _between(parts: tuple[NDArray, NDArray, NDArray], s: NDArray, y: NDArray, x: NDArray) -> NDArray:
    """(k, a, b) y (s²M′ + sC′ + K̃′) x for y (k, a, r) and x (k, r, b)."""
    mass, viscous, still = parts
    at = s[:, None, None]
    return np.asarray(y @ (at**2 * (mass @ x) + at * (viscous @ x) + still @ x))
