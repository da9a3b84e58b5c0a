"""Derivatives of FRFs by the parameters: H′ = −C Z⁻¹ Z′ Z⁻¹ B from the response to inputs and to unit outputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.errors import FemtuneError
from femtune.modal import FrfSet
from femtune.modal.kinds import FrfKind
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.kinds import FrfMethod
from femtune.model.response.basis import ModalBasis, modes_alone
from femtune.model.response.dynamic_stiffness import DynamicStiffness
from femtune.model.response.frf_methods import (
    Progress,
    Request,
    System,
    as_frf_set,
    checked_request,
    direct_fields,
    reduced_system,
    system_on,
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
    kind: FrfKind = "accelerance",
    method: FrfMethod = "real-modes",
    *,
    damping: DampingRatios | None = None,
    residual_vectors: bool = True,
    derivatives: bool = True,
    left_out: Sequence[int] = (),
    decay: float = 0.0,
    progress: Progress | None = None,
) -> FrfGradient:
    """FRFs and their derivatives; arguments and errors as of `frf`.

    Without `derivatives` (gradients of no columns) the functions come from the same basis, which `frf` would make
    smaller, so that values of points with and without derivatives compare.

    "direct": one factorisation a line serves value and derivatives. The modal ways take the response to inputs and to
    unit forces at the outputs from the modes, and residual vectors for both. The derivatives are those of the functions
    as they are computed, however few the modes are: the changes of modes and residual vectors are part of them. Complex
    modes whose poles coincide have no derivatives; with them the gradient converges with the number of modes.
    Derivatives of modal damping include the change of its mode, and of ζ where it is a function of frequency.

    `left_out` are positions of real modes Q whose own response CQ (QᵀZQ)⁻¹ QᵀB is taken away: the term of each mode in
    the modal sum, or of its subspace where damping couples them. They need a solution as `model` (error
    ``response.modes-needed``).
    """
    request = checked_request(model, ports, freq_hz, kind, method, damping, decay)
    count = request.stiffness.point.n_parameters if derivatives else 0
    if method == "direct":
        receptance, gradient = _direct(request, count, progress)
    else:
        outputs = request.ports.outputs.T.toarray()
        system = reduced_system(request, residual_vectors, outputs)
        receptance, gradient = _superposed(request, system, count)
    if left_out:
        part, slope = _superposed(request, system_of_modes(request, left_out), count)
        receptance, gradient = receptance - part, gradient - slope
    names = request.stiffness.point.configured.model.parameters.free[:count]
    scaled = np.moveaxis(gradient * request.factor[:, None, None, None], 0, 2)
    return FrfGradient(as_frf_set(request, receptance), scaled, tuple(p.name for p in names))


def system_of_modes(request: Request, members: Sequence[int]) -> System:
    """Some real modes alone, whatever the method of the functions that they are part of."""
    if request.modes is None:
        raise FemtuneError("response.modes-needed", method=request.method)
    return system_on(replace(request, method="real-modes"), modes_alone(request.modes, members))


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
    """Values, and their exact derivatives: of the reduced matrices with the basis as it changes.

    H = C Q Z_r⁻¹ QᵀB gives H′ = y(QᵀB)′ + (CQ)′x − y Z_r′ x with Z_r′ = QᵀZ′Q + Q′ᵀZQ + QᵀZQ′.
    """
    reduced, b = system.reduced, system.reduced.inputs.shape[1]
    q = system.respond(request.s, np.hstack([reduced.inputs, reduced.outputs.T]))
    x, y = q[:, :, :b], np.swapaxes(q[:, :, b:], 1, 2)
    derivatives = []
    for j, moved in enumerate(_moved(request, reduced.basis) if count else ()):
        projected = projected_derivatives(request.stiffness, reduced.basis.vectors, j)
        parts = tuple(a + n + n.T for a, n in zip(projected, moved.parts))
        derivatives.append(y @ moved.inputs + moved.outputs.T @ x - _between(parts, request.s, y, x))
    shape = (len(request.s), len(reduced.outputs), b, 0)
    return np.asarray(reduced.outputs @ x), np.stack(derivatives, axis=-1) if derivatives else np.zeros(shape)


@dataclass(frozen=True, eq=False)
class _Moved:
    """Q′ᵀB (r, n_in), Q′ᵀCᵀ (r, n_out), and Q′ᵀMQ, Q′ᵀCQ and Q′ᵀ(K + iH)Q (r, r), by one parameter."""

    inputs: NDArray
    outputs: NDArray
    parts: tuple[NDArray, NDArray, NDArray]


def _moved(request: Request, basis: ModalBasis) -> Iterator[_Moved]:
    """How the basis changes, by each parameter."""
    stiffness, Q, r = request.stiffness, basis.vectors, basis.vectors.shape[1]
    B, C = request.ports.inputs.toarray(), request.ports.outputs.T.toarray()
    still = stiffness.stiffness_times(Q)
    columns = [B, C, stiffness.point.mass @ Q, stiffness.viscous_times(Q), still.real, still.imag]
    # columns that are zero would cost as many solutions as the others
    some = [bool(np.any(one)) for one in columns]
    ends = np.cumsum([one.shape[1] * known for one, known in zip(columns, some)])[:-1]
    for slopes in basis.slopes(np.hstack([one for one, known in zip(columns, some) if known])):
        cut = np.split(slopes, ends, axis=1)
        inputs, outputs, mass, viscous, real, imaginary = (
            part if known else np.zeros((r, one.shape[1])) for part, known, one in zip(cut, some, columns)
        )
        yield _Moved(inputs, outputs, (mass, viscous, real + 1j * imaginary))


def projected_derivatives(stiffness: DynamicStiffness, Q: NDArray, j: int) -> tuple[NDArray, NDArray, NDArray]:
    """QᵀM′Q, QᵀC′Q and Qᵀ(K′ + iH′)Q by parameter j, modal damping in the one where it belongs."""
    viscous = Q.T @ stiffness.viscous_derivative_times(j, Q)
    return Q.T @ (stiffness.point.mass_derivatives[j] @ Q), viscous, Q.T @ stiffness.stiffness_derivative_times(j, Q)


def _between(parts: tuple[NDArray, NDArray, NDArray], s: NDArray, y: NDArray, x: NDArray) -> NDArray:
    """(k, a, b) y (s²M′ + sC′ + K̃′) x for y (k, a, r) and x (k, r, b)."""
    mass, viscous, still = parts
    at = s[:, None, None]
    return np.asarray(y @ (at**2 * (mass @ x) + at * (viscous @ x) + still @ x))
