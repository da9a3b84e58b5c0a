"""Responses of the full model, from the journal of the run folder where it has them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from femtune import __version__
from femtune.model import EigenSolution, ModalDamping, ModelPoint, digest, matrices_digest
from femtune.model.digest import Part
from femtune.model.response import Ports, StaticResponse, complex_modes, frf, static_response
from femtune.model.response.rigid import is_rigid
from femtune.study.journal import SCHEMA, Form
from femtune.study.journal_entry import Entry
from femtune.study.journaled import JournaledSolver
from femtune.study.load import Study
from femtune.study.response_request import ResponseRequest

T = TypeVar("T")
Solve = Callable[[], EigenSolution]

_KINDS = ("rigid", "oscillating", "real")
_POLES = {"freq_hz": np.float64, "damping_ratio": np.float64, "phase_collinearity": np.float64,
          "kind": np.int64, "real_mode": np.int64, "real_freq_hz": np.float64}  # fmt: skip


@dataclass(frozen=True, eq=False)
class PoleTable:
    """Complex modes and the real modes that they resemble most, all (m,); `kind` is a position in "rigid",
    "oscillating", "real"; damping ratios of rigid-body modes are NaN."""

    freq_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    phase_collinearity: NDArray[np.float64]
    kind: NDArray[np.int64]
    real_mode: NDArray[np.int64]
    real_freq_hz: NDArray[np.float64]

    def kind_words(self) -> list[str]:
        """The kinds in words."""
        return [_KINDS[k] for k in self.kind]


def solved_frfs(
    study: Study,
    request: ResponseRequest,
    point: ModelPoint,
    modes: Solve,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.complex128]:
    """(outputs, inputs, lines) values; `modes` is called where they are needed and the journal has no solution.

    `progress` is called with the lines that are done, and with all.
    """
    table, ports = request.table, request.ports
    shape = (ports.outputs.shape[0], ports.inputs.shape[1], len(request.freq_hz))

    def solve() -> NDArray[np.complex128]:
        model = modes() if request.needs_modes else point
        found = frf(
            model, ports, request.freq_hz, table.kind, request.method, damping=request.damping,
            residual_vectors=table.residual_vectors, progress=progress,
        )  # fmt: skip
        return np.ascontiguousarray(found.values)

    form = Form("frf", _of_values, partial(_values, shape))
    parts = (table.kind, request.method, table.residual_vectors, request.freq_hz, *_of_ports(ports))
    return _obtained(study, form, (_matrices(point), *_chosen(request, point), *parts), solve)


def solved_poles(study: Study, request: ResponseRequest, point: ModelPoint, modes: Solve) -> PoleTable:
    """Complex modes, as many as there are real modes up to the highest line."""
    top = float(request.freq_hz[-1])
    form = Form("poles", _of_poles, _poles)
    return _obtained(
        study,
        form,
        (_matrices(point), *_chosen(request, point), top),
        lambda: pole_table(modes(), request.damping, top),
    )


def solved_static(study: Study, point: ModelPoint, ports: Ports) -> tuple[NDArray[np.float64], bool]:
    """(outputs, loads) displacements, and whether the structure is free (inertia relief)."""

    def solve() -> tuple[NDArray[np.float64], bool]:
        found: StaticResponse = static_response(point, ports)
        return np.ascontiguousarray(found.values.real, dtype=float), found.inertia_relief

    shape = (ports.outputs.shape[0], ports.inputs.shape[1])
    form = Form("static", _of_static, partial(_static, shape))
    # the elastic motion of a free structure depends on its mass
    return _obtained(study, form, (matrices_digest(point, "stiffness", "mass"), *_of_ports(ports)), solve)


def pole_table(modes: EigenSolution, damping: ModalDamping | None, top_hz: float) -> PoleTable:
    """The complex modes of a model beside its real modes."""
    natural = np.where(is_rigid(modes)[: modes.wanted], 0.0, modes.freq_hz)
    found = complex_modes(modes, max(1, int((natural <= top_hz).sum())), damping)
    overlap = np.abs(modes.shapes[:, : modes.wanted].T @ (modes.point.mass @ found.shapes))
    like = np.argmax(overlap, axis=0)
    return PoleTable(
        found.freq_hz, found.damping_ratio, found.phase_collinearity,
        np.array([_KINDS.index(k) for k in found.kinds], np.int64), like.astype(np.int64), natural[like],
    )  # fmt: skip


def _obtained(study: Study, form: Form[T], parts: Iterable[Part], solve: Callable[[], T]) -> T:
    solver = study.solver
    if not isinstance(solver, JournaledSolver):
        return solve()
    return solver.journal.obtain(form, digest(__version__, SCHEMA, form.kind, *parts), solve)


def _matrices(point: ModelPoint) -> str:
    return matrices_digest(point, "stiffness", "mass", "viscous", "hysteretic")


def _of_ports(ports: Ports) -> tuple[Part, ...]:
    return (ports.inputs, ports.outputs)


def _chosen(request: ResponseRequest, point: ModelPoint) -> tuple[Part, ...]:
    """Modes and their damping."""
    damping = request.damping
    own = (f"{number} {float(ratio.value)!r}" for number, ratio in sorted(point.mode_ratios.items()))
    modes = (*request.modes, *own)
    if damping is None:
        return (*modes, None)
    flags = f"{damping.by_mode} {damping.unit} {damping.flat} {damping.hysteretic}"
    return (*modes, damping.values, damping.freq_hz, flags)


def _of_values(values: NDArray[np.complex128]) -> Entry:
    return Entry({"values": values}, {})


def _values(shape: tuple[int, ...], entry: Entry) -> NDArray[np.complex128]:
    return _array(entry, "values", np.complex128, shape)


def _of_static(found: tuple[NDArray[np.float64], bool]) -> Entry:
    return Entry({"values": found[0]}, {"inertia_relief": found[1]})


def _static(shape: tuple[int, ...], entry: Entry) -> tuple[NDArray[np.float64], bool]:
    relief = entry.facts["inertia_relief"]
    if not isinstance(relief, bool):
        raise TypeError("inertia_relief is neither true nor false")
    return _array(entry, "values", np.float64, shape), relief


def _of_poles(table: PoleTable) -> Entry:
    return Entry({name: getattr(table, name) for name in _POLES}, {})


def _poles(entry: Entry) -> PoleTable:
    shape = entry.arrays["kind"].shape[:1]
    table = PoleTable(**{name: _array(entry, name, kind, shape, name == "damping_ratio")
                         for name, kind in _POLES.items()})  # fmt: skip
    if not np.isin(table.kind, (0, 1, 2)).all() or (table.real_mode < 0).any():
        raise ValueError("its kinds or modes are out of their range")
    return table


def _array(entry: Entry, name: str, kind: type, shape: tuple[int, ...], gaps: bool = False) -> NDArray[Any]:
    array = entry.arrays[name]
    if array.dtype != np.dtype(kind) or array.shape != shape or not (gaps or np.isfinite(array).all()):
        raise ValueError(f"{name} is {array.dtype}{list(array.shape)} instead of finite {np.dtype(kind)}{list(shape)}")
    return array
