"""Frequency response functions by three ways: directly, by real modes, by complex modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.modal import FrfSet
from femtune.modal.frf_set import KINDS
from femtune.modal.kinds import FrfKind
from femtune.model.configured import ModelPoint
from femtune.model.eigen.solution import EigenSolution
from femtune.model.kinds import FrfMethod
from femtune.model.response.basis import ModalBasis, damping_forces, modal_basis
from femtune.model.response.complex_derivatives import complex_basis
from femtune.model.response.dynamic_stiffness import DynamicStiffness, NoSolutionError
from femtune.model.response.modal_damping import DampingRatios, modal_damper
from femtune.model.response.ports import Ports
from femtune.model.response.reduced import ReducedStiffness, fields, pole_residues, reduce

# ----------------------------------------------------------------------------------------------------
# The checked request for FRFs: lines, kind, method.


METHODS: tuple[FrfMethod, ...] = get_args(FrfMethod)


@dataclass(frozen=True, eq=False)
class Request:
    """Checked request: `s` (k,) is σ + iω, `factor` (k,) what turns receptance into the kind that is wanted."""

    stiffness: DynamicStiffness
    modes: EigenSolution | None
    ports: Ports
    freq_hz: Reals
    kind: FrfKind
    method: FrfMethod
    decay: float = 0.0

    def stiffness_at(self, s: complex) -> DynamicStiffness:
        """The dynamic stiffness with the values that tables over frequency have at s."""
        point = self.stiffness.point
        if not point.depends_on_frequency:
            return self.stiffness
        return DynamicStiffness(point.at_frequency(abs(s.imag) / (2.0 * np.pi)), self.stiffness.damper)

    @property
    def s(self) -> NDArray:
        """σ + iω."""
        return self.decay + 2j * np.pi * self.freq_hz

    @property
    def factor(self) -> NDArray:
        """s⁰, s¹ or s²."""
        return np.asarray(self.s ** KINDS.index(self.kind), dtype=np.complex128)


def checked_request(
    model: ModelPoint | EigenSolution,
    ports: Ports,
    freq_hz: ArrayLike,
    kind: FrfKind,
    method: FrfMethod,
    damping: DampingRatios | None,
    decay: float = 0.0,
) -> Request:
    """The request, or an error that says what is wrong with it.

    Raises
    ------
    FemtuneError : ``frf.kind``, ``response.method``, ``response.frequencies``, ``response.modes-needed``,
        ``response.ports-differ``, ``response.damping-ratio``, ``table.direct``
    """
    modes = model if isinstance(model, EigenSolution) else None
    point = model.point if isinstance(model, EigenSolution) else model
    _check_words(kind, method)
    if point.depends_on_frequency and (method != "direct" or damping is not None or point.mode_ratios):
        code = "table.direct" if method != "direct" else "table.direct/modal-damping"
        raise FemtuneError(code, method=method)
    if modes is None and (method != "direct" or damping is not None or point.mode_ratios):
        code = "response.modes-needed/damping" if method == "direct" else "response.modes-needed"
        raise FemtuneError(code, method=method)
    check_ports(point, ports)
    damper = None if modes is None else modal_damper(modes, damping)
    return Request(DynamicStiffness(point, damper), modes, ports, _lines(freq_hz), kind, method, decay)


def _check_words(kind: str, method: str) -> None:
    if kind not in KINDS:
        raise FemtuneError("frf.kind", kind=kind, kinds=", ".join(KINDS))
    if method not in METHODS:
        raise FemtuneError("response.method", method=method, methods=", ".join(METHODS))


def check_ports(point: ModelPoint, ports: Ports) -> None:
    """Refuse ports of another configuration (error ``response.ports-differ``)."""
    n = point.configured.n_free
    if ports.inputs.shape[0] != n or ports.outputs.shape[1] != n:
        raise FemtuneError(
            "response.ports-differ", values={"free DOFs of the model": n, "of the ports": ports.outputs.shape[1]}
        )


def _lines(freq_hz: ArrayLike) -> Reals:
    lines = np.atleast_1d(np.asarray(freq_hz, dtype=float))
    good = lines.ndim == 1 and lines.size and np.isfinite(lines).all() and (lines >= 0).all()
    if not good or (np.diff(lines) <= 0).any():
        raise FemtuneError(
            "response.frequencies", values={"lines (Hz)": ", ".join(f"{line:.6g}" for line in lines.ravel()[:6])}
        )
    return lines


def singular_at(point: ModelPoint, freq_hz: float) -> FemtuneError:
    """The error that the response is infinite at a frequency."""
    name = point.configured.configuration.name
    if freq_hz == 0.0:
        return FemtuneError("response.free-at-zero", name=name)
    return FemtuneError("response.resonance", values={"frequency (Hz)": f"{freq_hz:.9g}"}, name=name, freq_hz=freq_hz)


Progress = Callable[[int, int], None]
"""Called with the number of frequency lines that are done, and of all."""


def frf(
    model: ModelPoint | EigenSolution,
    ports: Ports,
    freq_hz: ArrayLike,
    kind: FrfKind = "accelerance",
    method: FrfMethod = "real-modes",
    *,
    damping: DampingRatios | None = None,
    residual_vectors: bool = True,
    decay: float = 0.0,
    progress: Progress | None = None,
) -> FrfSet:
    """FRFs of a model between its ports, convention e^{iωt}.

    Parameters
    ----------
    model : modes of a model point, or for the method "direct" without modal damping the point itself
    freq_hz : (k,) increasing; at 0 the limit from above is taken
    method : "direct" solves at each line; "real-modes" superposes the wanted modes and takes any damping along;
        "complex-modes" superposes as many complex modes, the poles and residues of the damped system
    damping : modal damping of the wanted modes, besides the dashpots and loss factors of the model
    residual_vectors : adds to the modes the static response to the inputs and to the forces of dashpots
    decay : σ in rad/s; the functions are those at s = σ + iω, as forces and responses with an exponential window
        e^{−σt} have them

    Returns
    -------
    FrfSet : values (outputs, inputs, k)

    Raises
    ------
    FemtuneError : codes ``response.*``, ``frf.kind``; ``response.resonance`` where a line is an undamped natural
        frequency, ``response.free-at-zero`` at 0 Hz where the structure is free
    """
    request = checked_request(model, ports, freq_hz, kind, method, damping, decay)
    if method == "direct":
        return as_frf_set(request, direct_receptance(request, progress))
    system = reduced_system(request, residual_vectors)
    return as_frf_set(request, superposed(request, system, progress))


@dataclass(frozen=True, eq=False)
class System:
    """A reduced dynamic stiffness and the way from forces and frequencies to its coordinates."""

    reduced: ReducedStiffness
    respond: Callable[[NDArray, NDArray], NDArray]


def reduced_system(request: Request, residual_vectors: bool, more_forces: NDArray | None = None) -> System:
    """The basis that the method superposes, with residual vectors for inputs and `more_forces` (n_free, b)."""
    assert request.modes is not None
    forces = _forces(request, more_forces) if residual_vectors else None
    return system_on(request, _basis(request, forces))


def system_on(request: Request, basis: ModalBasis) -> System:
    """The dynamic stiffness on a basis."""
    reduced = reduce(request.stiffness, basis, request.ports)
    if request.method == "complex-modes":
        return System(reduced, lambda s, f: pole_residues(reduced, f).fields(s))
    return System(reduced, lambda s, f: fields(reduced, s, f))


def _basis(request: Request, forces: NDArray | None) -> ModalBasis:
    assert request.modes is not None
    if request.method == "complex-modes":
        return complex_basis(request.modes, request.stiffness, forces)
    return modal_basis(request.modes, forces)


def _forces(request: Request, more: NDArray | None) -> NDArray:
    parts = [request.ports.inputs.toarray(), damping_forces(request.stiffness.point)]
    return np.hstack(parts if more is None else [*parts, more])


def as_frf_set(request: Request, receptance: NDArray) -> FrfSet:
    """Receptance (k, n_out, n_in) as an FrfSet of the kind that is wanted; not finite values are an error."""
    bad = ~np.isfinite(receptance).all(axis=(1, 2))
    if bad.any():
        raise singular_at(request.stiffness.point, float(request.freq_hz[bad][0]))
    ports, values = request.ports, np.moveaxis(receptance * request.factor[:, None, None], 0, -1)
    source = f"model, configuration {request.stiffness.point.configured.configuration.name}, {request.method}"
    return FrfSet(
        request.freq_hz, values, ports.output_labels, ports.input_labels, request.kind, source=source,
        response_names=ports.output_names, reference_names=ports.input_names,
    )  # fmt: skip


def direct_receptance(request: Request, progress: Progress | None) -> NDArray:
    """(k, n_out, n_in) receptance by a solution at each line."""
    B, C = request.ports.inputs.toarray(), request.ports.outputs
    out = np.empty((len(request.freq_hz), C.shape[0], B.shape[1]), dtype=complex)
    for i, s in enumerate(request.s):
        out[i] = C @ direct_fields(request.stiffness_at(complex(s)), complex(s), B)
        if progress is not None:
            progress(i + 1, len(out))
    return out


def direct_fields(stiffness: DynamicStiffness, s: complex, forces: NDArray) -> NDArray:
    """Z(s)⁻¹ F (n_free, b)."""
    try:
        return stiffness.solver(s)(forces)
    except NoSolutionError as error:
        raise singular_at(stiffness.point, float(s.imag / (2.0 * np.pi))) from error


def superposed(request: Request, system: System, progress: Progress | None) -> NDArray:
    """(k, n_out, n_in) receptance on a basis."""
    q = system.respond(request.s, system.reduced.inputs)
    if progress is not None:
        progress(len(request.s), len(request.s))
    return np.asarray(system.reduced.outputs @ q)
