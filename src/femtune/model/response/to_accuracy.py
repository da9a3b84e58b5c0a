"""FRFs by superposition with a stated accuracy: vectors are added to the basis until the truncation error is small.

With a basis Q, u = Qx and the residual force r = f − Z(s)u, the error Z⁻¹r is nearly A r, where A is the static
flexibility of the modes that are not in the basis: these are far above the lines. A r is the estimate of the error, and
it is also the next vector of the basis. It is orthogonal in K to the basis, since Qᵀr = 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal import FrfSet
from femtune.modal.kinds import FrfKind
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.kinds import FrfMethod
from femtune.model.response.basis import ModalBasis, ritz_vectors, static_complement
from femtune.model.response.frf_methods import (
    Progress,
    Request,
    System,
    as_frf_set,
    checked_request,
    direct_fields,
    direct_receptance,
    reduced_system,
    superposed,
    system_on,
)
from femtune.model.response.modal_damping import DampingRatios
from femtune.model.response.ports import Ports

ACCURACY = 1e-5
"""Truncation error of FRFs relative to their values, if vectors are added to the basis."""
_BETWEEN_LINES = 0.1
"""The estimates at the sampled lines stay below this part of `ACCURACY`, since other lines may have larger errors."""
_FLOOR = 1e-2
"""Errors of values below this fraction of the largest one of their function, near antiresonances, are relative to
it."""
_ZERO = 1e-12
"""Functions below this fraction of the largest one are zero but for rounding."""
_EVEN_LINES = 5
"""Evenly spaced lines at which the error is estimated, besides a peak and an antiresonance."""
_MOST_ROUNDS = 12
"""Extensions of the basis at most."""
_LEAST_GAIN = 0.5
"""Factor by which an extension must reduce the error for another one to be worth its solutions."""
_SAME_FORCE = 1e-6
"""Singular values of residual forces, relative to the largest, below which a force is a combination of the others."""
MOST_DOFS_DIRECT = 30_000
"""Larger models are not compared with direct solutions, each of which costs a factorisation."""


@dataclass(frozen=True, eq=False)
class WithError:
    """FRFs and their truncation error.

    Parameters
    ----------
    frfs : values (outputs, inputs, k)
    error : largest truncation error at some lines, relative to the value, or to 1 % of the largest value of the
        function where this is larger; zero for the direct method, None if it is not known
    """

    frfs: FrfSet
    error: float | None


def frf_with_error(
    model: ModelPoint | EigenSolution,
    ports: Ports,
    freq_hz: ArrayLike,
    kind: FrfKind = "accelerance",
    method: FrfMethod = "real-modes",
    *,
    damping: DampingRatios | None = None,
    residual_vectors: bool = True,
    add_vectors: bool = True,
    decay: float = 0.0,
    progress: Progress | None = None,
) -> WithError:
    """FRFs as of `frf`, with vectors that reduce the truncation error to `ACCURACY`, and the error.

    Parameters
    ----------
    model, ports, freq_hz, kind, method, damping, residual_vectors, decay, progress : as of `frf`
    add_vectors : whether vectors are added; the modes must reach well above the lines. Else the error is found by
        direct solutions at a few lines, for models up to `MOST_DOFS_DIRECT` DOFs.

    Raises
    ------
    FemtuneError : as `frf`
    """
    request = checked_request(model, ports, freq_hz, kind, method, damping, decay)
    if method == "direct":
        return WithError(as_frf_set(request, direct_receptance(request, progress)), 0.0)
    system = reduced_system(request, residual_vectors)
    error: float | None
    if residual_vectors and add_vectors:
        system, error = _enriched(request, system)
    else:
        error = _beside_direct(request, system)
    return WithError(as_frf_set(request, superposed(request, system, progress)), error)


@dataclass(frozen=True, eq=False)
class _Sample:
    """A request at some of its lines; |values| (k, outputs, inputs) there, and the largest ones over all lines."""

    request: Request
    values: Reals
    largest: Reals

    def relative(self, errors: Complexes) -> float:
        """Largest error of the receptance (k, outputs, inputs) relative to the values."""
        size = np.maximum(self.values, _FLOOR * self.largest)
        counted = np.broadcast_to(self.largest > _ZERO * self.largest.max(initial=0.0), size.shape)
        size_of_errors = np.abs(errors * self.request.factor[:, None, None])
        return float((size_of_errors[counted] / size[counted]).max(initial=0.0))


def _enriched(request: Request, system: System) -> tuple[System, float]:
    """The system with further vectors, and the estimated error that is left."""
    last = np.inf
    for _ in range(_MOST_ROUNDS):
        some = _sample(request, system)
        if not len(some.values):
            return system, 0.0
        vectors, errors = _missed(some.request, system)
        error = some.relative(errors)
        if error <= _BETWEEN_LINES * ACCURACY or error > _LEAST_GAIN * last or not vectors.shape[1]:
            return system, error
        system, last = system_on(request, _extended(request.stiffness.point, system.reduced.basis, vectors)), error
    return system, last


def _sample(request: Request, system: System) -> _Sample:
    """Evenly spaced lines above 0 Hz, and those at the highest peak and the deepest antiresonance."""
    values = np.abs(superposed(request, system, None) * request.factor[:, None, None])
    some = np.flatnonzero((request.freq_hz > 0.0) & np.isfinite(values).all(axis=(1, 2)))
    largest = values[some].max(axis=0, initial=0.0)
    if not some.size:
        return _Sample(request, values[:0], largest)
    counted = largest > _ZERO * largest.max()
    parts = values[some][:, counted] / largest[counted]
    even = np.linspace(0, len(some) - 1, _EVEN_LINES).round().astype(int)
    highest, deepest = values[some].max(axis=(1, 2)).argmax(), parts.min(axis=1, initial=1.0).argmin()
    at = some[np.unique([*even, int(highest), int(deepest)])]
    return _Sample(replace(request, freq_hz=request.freq_hz[at]), values[at], largest)


def _missed(request: Request, system: System) -> tuple[Reals, Complexes]:
    """Vectors A r of the residual forces at the lines, and what they add to the receptance (k, outputs, inputs)."""
    assert request.modes is not None
    basis, forces = system.reduced.basis, request.ports.inputs.toarray()
    q = system.respond(request.s, system.reduced.inputs)
    left = [forces - request.stiffness.times(complex(s), basis.vectors @ x) for s, x in zip(request.s, q)]
    pushed, back = _independent(np.hstack([part for r in left for part in (r.real, r.imag)]))
    vectors = static_complement(request.modes, basis.n_modes, pushed)
    parts = (request.ports.outputs @ vectors @ back).reshape(-1, len(left), 2, forces.shape[1])
    energy = np.einsum("ij,ij->j", vectors, request.modes.point.stiffness @ vectors)
    return vectors[:, energy > 0.0], np.moveaxis(parts[:, :, 0] + 1j * parts[:, :, 1], 1, 0)


def _independent(columns: Reals) -> tuple[Reals, Reals]:
    """U (n, k) orthonormal and R (k, g) with `columns` = U R, to a small part of each column."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    U, values, V = la.svd(scaled, full_matrices=False)
    kept = values > _SAME_FORCE * values.max(initial=0.0)
    return U[:, kept], (values[kept, None] * V[kept]) * size


def _extended(point: ModelPoint, basis: ModalBasis, vectors: Reals) -> ModalBasis:
    """The basis with further vectors that are orthogonal to its first modes; without slopes."""
    first = basis.n_modes
    rest = np.hstack([basis.vectors[:, first:], vectors])
    turn, k, m = ritz_vectors(point, rest)
    return ModalBasis(
        np.hstack([basis.vectors[:, :first], rest @ turn]),
        np.concatenate([basis.stiffness[:first], k]),
        np.concatenate([basis.mass[:first], m]),
        first,
    )


def _beside_direct(request: Request, system: System) -> float | None:
    """The error at some lines by direct solutions; None for large models, and where these are singular."""
    if request.stiffness.point.configured.n_free > MOST_DOFS_DIRECT:
        return None
    some = _sample(request, system)
    few, forces = some.request, request.ports.inputs.toarray()
    if not len(some.values):
        return 0.0
    try:
        exact = np.array([few.ports.outputs @ direct_fields(few.stiffness, complex(s), forces) for s in few.s])
    except FemtuneError:
        return None
    # a function whose modes are all missing is zero in the basis
    size = np.abs(exact * few.factor[:, None, None])
    return _Sample(few, size, np.maximum(some.largest, size.max(axis=0))).relative(
        superposed(few, system, None) - exact
    )
