"""The request of [response] for one configuration: ports, lines, damping, and the measured functions to compare
with."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune import __version__
from femtune.errors import FemtuneError, Notice
from femtune.journal.entry import Entry
from femtune.journal.journal import SCHEMA, Form
from femtune.journal.solver import JournaledSolver
from femtune.modal import as_kind
from femtune.model import (
    EigenSolution,
    constant_damping,
    damping_by_mode,
    digest,
    matrices_digest,
)
from femtune.model.kinds import FRF_METHODS, FrfMethod
from femtune.model.response import TIMES_HIGHEST_LINE, complex_modes, frf_with_error, matrix_ports, static_response
from femtune.model.response.rigid import is_rigid
from femtune.study.axes import named_axis, seen_as, sensor_axis
from femtune.study.error_places import errors_at

if TYPE_CHECKING:
    from femtune.arrays import Reals
    from femtune.files.study_file import ResponseTable, StudyFile
    from femtune.modal import FrfSet
    from femtune.model import (
        ModalDamping,
        ModelPoint,
    )
    from femtune.model.digests import Part
    from femtune.model.response import Ports, StaticResponse
    from femtune.study.axes import Axis
    from femtune.study.cases import StudyCase
    from femtune.study.study import Study

_MOST_VALUES = 200_000_000
"""Complex values of all functions; more than these 3 GB are refused before anything is solved."""


@dataclass(frozen=True, eq=False)
class ResponseRequest:
    """Ports and lines of a configuration; `measured` has the outputs, inputs and kind of the request, NaN elsewhere.

    `decay` is σ in rad/s where the model's functions are wanted at σ + iω, as an exponential window makes them.
    """

    case: StudyCase
    table: ResponseTable
    outputs: Axis
    inputs: Axis
    ports: Ports
    freq_hz: Reals
    damping: ModalDamping | None
    measured: FrfSet | None
    notices: tuple[Notice, ...]
    decay: float = 0.0

    @property
    def method(self) -> FrfMethod:
        """The way as the model's functions call it."""
        return FRF_METHODS[self.table.method]

    @property
    def modes(self) -> tuple[int | None, float | None]:
        """Number of modes, or their upper frequency: by default twice the highest line."""
        table = self.table
        if table.modes is not None or table.max_hz is not None:
            return table.modes, table.max_hz
        top = float(self.freq_hz[-1])
        return (None, TIMES_HIGHEST_LINE * top) if top > 0.0 else (1, None)

    @property
    def limit(self) -> str:
        """The key that limits the basis: ``modes = 3``; "" if there is none."""
        table = self.table
        if self.method == "direct":
            return ""
        if not table.residual_vectors:
            return "residual_vectors = false"
        named = ((key, getattr(table, key)) for key in ("modes", "max_hz"))
        return next((f"{key} = {value:g}" for key, value in named if value is not None), "")

    @property
    def needs_modes(self) -> bool:
        """True if the functions cannot be computed without modes."""
        mode_ratios = self.case.configured.model.structure.damping.mode_ratios
        return self.method != "direct" or self.damping is not None or bool(mode_ratios)


def response_request(study: Study, case: StudyCase, table: ResponseTable) -> ResponseRequest:
    """The request of a configuration.

    Raises
    ------
    FemtuneError : ``response.no-inputs``, ``response.no-outputs``, ``response.no-lines``, ``response.too-many-values``,
        ``response.held-port``, ``model.unknown-node``, ``model.component``
    """
    frfs = case.test.frfs if case.test is not None else None
    inputs, about_inputs = _inputs(study.file, case, table, frfs)
    outputs, about_outputs = _outputs(study.file, case, table, frfs, inputs)
    freq_hz, about_lines = _lines(study.file, case, table, frfs)
    _check_size(study.file, outputs, inputs, freq_hz)
    with errors_at(study.file.where("response")):
        ports = matrix_ports(case.configured, inputs.rows, outputs.rows, inputs.labels, outputs.labels)
    compared = None if frfs is None else _compared(study.file, as_kind(frfs, table.kind))
    measured = None if compared is None else _measured(case, compared, outputs, inputs)
    notices = tuple(dict.fromkeys((*about_inputs, *about_outputs, *about_lines)))
    return ResponseRequest(
        case=case,
        table=table,
        outputs=outputs,
        inputs=inputs,
        ports=ports,
        freq_hz=freq_hz,
        damping=modal_damping(study, table),
        measured=measured,
        notices=notices,
    )


def modal_damping(study: Study, table: ResponseTable) -> ModalDamping | None:
    """The damping of modes: the study's ratios, else the table that the deck selects."""
    if table.ratio is not None:
        return constant_damping(table.ratio)
    return damping_by_mode(table.ratios) if table.ratios is not None else study.built.modal_damping


def _inputs(
    file: StudyFile, case: StudyCase, table: ResponseTable, frfs: FrfSet | None
) -> tuple[Axis, tuple[Notice, ...]]:
    if table.inputs is not None:
        return named_axis(file, case, table.inputs, "response", "inputs"), ()
    if frfs is not None:
        axis, notices = sensor_axis(case, frfs.references)
        if len(axis.labels):
            return axis, notices
    raise _nothing(file, case, "response.no-inputs" if case.test is not None else "response.no-inputs/no-test")


def _outputs(
    file: StudyFile, case: StudyCase, table: ResponseTable, frfs: FrfSet | None, inputs: Axis
) -> tuple[Axis, tuple[Notice, ...]]:
    if table.outputs is not None:
        return named_axis(file, case, table.outputs, "response", "outputs"), ()
    if case.all_sensors is None:
        return inputs, ()
    axis, notices = sensor_axis(case, frfs.responses if frfs is not None else case.all_sensors.dofs)
    if len(axis.labels):
        return axis, notices
    raise _nothing(file, case, "response.no-outputs")


def _nothing(file: StudyFile, case: StudyCase, code: str) -> FemtuneError:
    return FemtuneError(code, where=file.where("response"), configuration=case.name)


def _lines(
    file: StudyFile, case: StudyCase, table: ResponseTable, frfs: FrfSet | None
) -> tuple[Reals, tuple[Notice, ...]]:
    """Frequency lines: even ones, or those of the test within from_hz and to_hz."""
    low, high = table.from_hz, table.to_hz
    if low is not None and high is not None and (table.step_hz or table.lines):
        return _even(low, high, table), ()
    if frfs is None:
        raise _no_lines(file, case, "its test has no FRFs" if case.test is not None else "it has no test")
    inside = (frfs.freq_hz >= (low or 0.0)) & (frfs.freq_hz <= (np.inf if high is None else high))
    chosen = frfs.freq_hz[inside & (frfs.freq_hz > 0.0)]
    if not chosen.size:
        raise _no_lines(file, case, "its test has no lines between from_hz and to_hz")
    # a line at 0 Hz is an artefact of the analyser's transform: a free structure has no response there
    dropped = bool((inside & (frfs.freq_hz == 0.0)).any())
    return np.asarray(chosen), (Notice("response.zero-line", level="info", configuration=case.name),) if dropped else ()


def _even(low: float, high: float, table: ResponseTable) -> Reals:
    if table.step_hz is None:
        return np.linspace(low, high, table.lines or 1)
    count = int(np.floor((high - low) / table.step_hz * (1.0 + 1e-12) + 1e-9)) + 1
    return np.asarray(low + table.step_hz * np.arange(count))


def _no_lines(file: StudyFile, case: StudyCase, why: str) -> FemtuneError:
    return FemtuneError("response.no-lines", where=file.where("response"), configuration=case.name, reason=why)


def _check_size(file: StudyFile, outputs: Axis, inputs: Axis, freq_hz: Reals) -> None:
    count = len(outputs.labels) * len(inputs.labels) * len(freq_hz)
    if count > _MOST_VALUES:
        raise FemtuneError(
            "response.too-many-values",
            where=file.where("response"),
            values={"outputs": len(outputs.labels), "inputs": len(inputs.labels), "lines": len(freq_hz)},
            count=count,
            most_values=_MOST_VALUES,
        )


def _compared(file: StudyFile, frfs: FrfSet) -> FrfSet:
    """The measured functions, NaN in bands that [equalise] leaves out of all comparisons."""
    if file.equalise is None:
        return frfs
    out = np.zeros(len(frfs.freq_hz), bool)
    for low, high in file.equalise.not_compared_hz:
        out |= (frfs.freq_hz >= low) & (frfs.freq_hz <= high)
    return replace(frfs, values=np.where(out, complex(np.nan, np.nan), frfs.values))


def _measured(case: StudyCase, frfs: FrfSet, outputs: Axis, inputs: Axis) -> FrfSet | None:
    """The measured functions on the request's outputs and inputs; None if there are none."""
    rows, row_signs = seen_as(outputs, case, frfs.responses)
    columns, column_signs = seen_as(inputs, case, frfs.references)
    shape = (len(rows), len(columns), len(frfs.freq_hz))
    values = np.full(shape, complex(np.nan, np.nan))
    i, j = np.flatnonzero(rows >= 0), np.flatnonzero(columns >= 0)
    signs = row_signs[i][:, None, None] * column_signs[j][None, :, None]
    values[np.ix_(i, j)] = signs * frfs.values[np.ix_(rows[i], columns[j])]
    if np.isnan(values).all():
        return None
    return replace(frfs, values=values, responses=outputs.labels, references=inputs.labels, coherence=None)


# ----------------------------------------------------------------------------------------------------
# Responses of the full model, from the journal of the run folder if it has them.


T = TypeVar("T")
Solve = Callable[[], EigenSolution]

_KINDS = ("rigid", "oscillating", "real")
"""Kinds of complex modes; a table of modes has positions in this list."""
_POLES = {"freq_hz": np.float64, "damping_ratio": np.float64, "phase_collinearity": np.float64,
          "kind": np.int64, "real_mode": np.int64, "real_freq_hz": np.float64}  # fmt: skip
"""Arrays of a `ComplexModeTable` with one value for each mode, as the journal keeps them."""


@dataclass(frozen=True, eq=False)
class ComplexModeTable:
    """Complex modes and the real modes that they resemble most, all (m,); `kind` is a position in "rigid",
    "oscillating", "real"; damping ratios of rigid-body modes are NaN. `motion` (r, m) are their shapes as rows see them
    that the caller chose."""

    freq_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    phase_collinearity: NDArray[np.float64]
    kind: NDArray[np.int64]
    real_mode: NDArray[np.int64]
    real_freq_hz: NDArray[np.float64]
    motion: NDArray[np.complex128]

    def kind_words(self) -> list[str]:
        """The kinds in words."""
        return [_KINDS[k] for k in self.kind]


def solved_frfs(
    study: Study,
    request: ResponseRequest,
    point: ModelPoint,
    modes: Solve,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[NDArray[np.complex128], float | None]:
    """(outputs, inputs, lines) values, and the error of their truncation (`WithError.error`).

    `modes` is called if they are needed and the journal has no solution. `progress` is called with the lines that
    are done, and with all.
    """
    table, ports = request.table, request.ports
    shape = (ports.outputs.shape[0], ports.inputs.shape[1], len(request.freq_hz))

    def solve() -> tuple[NDArray[np.complex128], float | None]:
        model = modes() if request.needs_modes else point
        solved = frf_with_error(
            model, ports, request.freq_hz, table.kind, request.method, damping=request.damping,
            residual_vectors=table.residual_vectors, add_vectors=not request.limit, decay=request.decay,
            progress=progress,
        )  # fmt: skip
        return np.ascontiguousarray(solved.frfs.values), solved.error

    return _obtained(study, Form("frf", _of_values, partial(_values, shape)), parts_of_frfs(request, point), solve)


def parts_of_frfs(request: ResponseRequest, point: ModelPoint) -> tuple[Part, ...]:
    """All that FRFs of a model point depend on."""
    table = request.table
    parts = (table.kind, request.method, table.residual_vectors, request.freq_hz, *_of_ports(request.ports))
    if request.decay:
        parts = (*parts, request.decay)
    # the same number of modes may be what the lines need, to which vectors are added, or what the study states
    return (_matrices(point), *_chosen(request, point), request.limit, *parts)


def solved_poles(
    study: Study, request: ResponseRequest, point: ModelPoint, modes: Solve, rows: sp.csr_array
) -> ComplexModeTable:
    """Complex modes, as many as there are real modes up to the highest line; their shapes as `rows` (r, n_free) see
    them."""
    top = float(request.freq_hz[-1])
    form = Form("poles", _of_poles, partial(_poles, rows.shape[0]))
    return _obtained(
        study,
        form,
        (_matrices(point), *_chosen(request, point), top, rows),
        lambda: pole_table(modes(), request.damping, top, rows),
    )


def solved_static(study: Study, point: ModelPoint, ports: Ports) -> tuple[NDArray[np.float64], bool]:
    """(outputs, loads) displacements, and whether the structure is free (inertia relief)."""

    def solve() -> tuple[NDArray[np.float64], bool]:
        response: StaticResponse = static_response(point, ports)
        return np.ascontiguousarray(response.values.real, dtype=float), response.inertia_relief

    shape = (ports.outputs.shape[0], ports.inputs.shape[1])
    form = Form("static", _of_static, partial(_static, shape))
    # the elastic displacements of a free structure depend on its mass
    return _obtained(study, form, (matrices_digest(point, "stiffness", "mass"), *_of_ports(ports)), solve)


def pole_table(
    modes: EigenSolution, damping: ModalDamping | None, top_hz: float, rows: sp.csr_array
) -> ComplexModeTable:
    """The complex modes of a model, each with the real mode that it resembles most."""
    natural = np.where(is_rigid(modes)[: modes.wanted], 0.0, modes.freq_hz)
    poles = complex_modes(modes, max(1, int((natural <= top_hz).sum())), damping)
    overlap = np.abs(modes.shapes[:, : modes.wanted].T @ (modes.point.mass @ poles.shapes))
    like = np.argmax(overlap, axis=0)
    return ComplexModeTable(
        poles.freq_hz, poles.damping_ratio, poles.phase_collinearity,
        np.array([_KINDS.index(k) for k in poles.kinds], np.int64), like.astype(np.int64), natural[like],
        np.asarray(rows @ poles.shapes),
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
    ratios = (f"{number} {float(ratio.value)!r}" for number, ratio in sorted(point.mode_ratios.items()))
    modes = (*request.modes, *ratios)
    if damping is None:
        return (*modes, None)
    flags = f"{damping.by_mode} {damping.unit} {damping.flat} {damping.hysteretic}"
    return (*modes, damping.values, damping.freq_hz, flags)


def _of_values(solved: tuple[NDArray[np.complex128], float | None]) -> Entry:
    return Entry({"values": solved[0]}, {"error": solved[1]})


def _values(shape: tuple[int, ...], entry: Entry) -> tuple[NDArray[np.complex128], float | None]:
    error = entry.facts["error"]
    if not (error is None or (isinstance(error, float) and error >= 0.0)):
        raise TypeError("error is neither a positive number nor null")
    return _array(entry, "values", np.complex128, shape), error


def _of_static(solved: tuple[NDArray[np.float64], bool]) -> Entry:
    return Entry({"values": solved[0]}, {"inertia_relief": solved[1]})


def _static(shape: tuple[int, ...], entry: Entry) -> tuple[NDArray[np.float64], bool]:
    relief = entry.facts["inertia_relief"]
    if not isinstance(relief, bool):
        raise TypeError("inertia_relief is neither true nor false")
    return _array(entry, "values", np.float64, shape), relief


def _of_poles(table: ComplexModeTable) -> Entry:
    return Entry({name: getattr(table, name) for name in (*_POLES, "motion")}, {})


def _poles(rows: int, entry: Entry) -> ComplexModeTable:
    shape = entry.arrays["kind"].shape[:1]
    columns = {name: _array(entry, name, kind, shape, name == "damping_ratio") for name, kind in _POLES.items()}
    table = ComplexModeTable(**columns, motion=_array(entry, "motion", np.complex128, (rows, *shape)))
    if not np.isin(table.kind, (0, 1, 2)).all() or (table.real_mode < 0).any():
        raise ValueError("its kinds or modes are out of their range")
    return table


def _array(entry: Entry, name: str, kind: type, shape: tuple[int, ...], gaps: bool = False) -> NDArray[Any]:
    array = entry.arrays[name]
    if array.dtype != np.dtype(kind) or array.shape != shape or not (gaps or np.isfinite(array).all()):
        raise ValueError(f"{name} is {array.dtype}{list(array.shape)} instead of finite {np.dtype(kind)}{list(shape)}")
    return array
