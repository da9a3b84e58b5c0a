"""What [response] asks of one configuration: ports, lines, damping, and the measured functions beside them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError, Notice
from femtune.files.study_file import ResponseTable, StudyFile
from femtune.modal import FrfSet, as_kind
from femtune.model import ModalDamping, constant_damping, damping_by_mode
from femtune.model.response import Method, Ports, matrix_ports
from femtune.study.cases import StudyCase
from femtune.study.load import Study
from femtune.study.located import located
from femtune.study.response_axes import Axis, named_axis, seen_as, sensor_axis

Reals = NDArray[np.float64]

_METHODS: dict[str, Method] = {"real modes": "real-modes", "complex modes": "complex-modes", "direct": "direct"}
_MOST_VALUES = 200_000_000
_AS_MANY = 2.0
"""Modes are superposed up to this many times the highest line."""


@dataclass(frozen=True, eq=False)
class ResponseRequest:
    """Ports and lines of a configuration; `measured` has the outputs, inputs and kind of the request, NaN elsewhere."""

    case: StudyCase
    table: ResponseTable
    outputs: Axis
    inputs: Axis
    ports: Ports
    freq_hz: Reals
    damping: ModalDamping | None
    measured: FrfSet | None
    notices: tuple[Notice, ...]

    @property
    def method(self) -> Method:
        """The way as the model's functions call it."""
        return _METHODS[self.table.method]

    @property
    def modes(self) -> tuple[int | None, float | None]:
        """How many modes, or up to which frequency: twice the highest line where nothing is said."""
        table = self.table
        if table.modes is not None or table.max_hz is not None:
            return table.modes, table.max_hz
        top = float(self.freq_hz[-1])
        return (None, _AS_MANY * top) if top > 0.0 else (1, None)

    @property
    def needs_modes(self) -> bool:
        """True where the functions cannot be computed without modes."""
        own = self.case.configured.model.structure.damping.mode_ratios
        return self.method != "direct" or self.damping is not None or bool(own)


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
    with located(study.file.where("response")):
        ports = matrix_ports(case.configured, inputs.rows, outputs.rows, inputs.labels, outputs.labels)
    measured = None if frfs is None else _measured(case, as_kind(frfs, table.kind), outputs, inputs)
    notices = tuple(dict.fromkeys((*about_inputs, *about_outputs, *about_lines)))
    return ResponseRequest(
        case, table, outputs, inputs, ports, freq_hz, modal_damping(study, table), measured, notices
    )  # fmt: skip


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
    raise _nothing(file, case, "inputs", "response.no-inputs")


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
    raise _nothing(file, case, "outputs", "response.no-outputs")


def _nothing(file: StudyFile, case: StudyCase, what: str, code: str) -> FemtuneError:
    has = "its test has no FRFs at grid points that move" if case.test is not None else "it has no test"
    return FemtuneError(
        code,
        f"configuration {case.name}: no {what} of the responses are given, and {has}",
        where=file.where("response"),
        hint=f'write {what} = ["12Z+"] in [response], with grid points of the model, or give --{what[:-1]} 12Z+',
    )


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
        raise _no_lines(file, case, "its test has no lines there")
    # a line at 0 Hz is an artefact of the analyser's transform: a free structure has no response there
    dropped = bool((inside & (frfs.freq_hz == 0.0)).any())
    what = f"{case.name}: the test's line at 0 Hz is left out of the responses"
    return np.asarray(chosen), (Notice("response.zero-line", what, level="info"),) if dropped else ()


def _even(low: float, high: float, table: ResponseTable) -> Reals:
    if table.step_hz is None:
        return np.linspace(low, high, table.lines or 1)
    count = int(np.floor((high - low) / table.step_hz * (1.0 + 1e-12) + 1e-9)) + 1
    return np.asarray(low + table.step_hz * np.arange(count))


def _no_lines(file: StudyFile, case: StudyCase, why: str) -> FemtuneError:
    return FemtuneError(
        "response.no-lines",
        f"configuration {case.name}: the frequency lines of the responses are not given, and {why}",
        where=file.where("response"),
        hint="write from_hz, to_hz and step_hz in [response], or give --from, --to and --step",
    )


def _check_size(file: StudyFile, outputs: Axis, inputs: Axis, freq_hz: Reals) -> None:
    count = len(outputs.labels) * len(inputs.labels) * len(freq_hz)
    if count > _MOST_VALUES:
        raise FemtuneError(
            "response.too-many-values",
            f"these are {count:.3g} values of frequency responses; {_MOST_VALUES:.3g} are the most",
            where=file.where("response"),
            values={"outputs": len(outputs.labels), "inputs": len(inputs.labels), "lines": len(freq_hz)},
            hint="name the outputs and inputs that matter, or take fewer lines",
        )


def _measured(case: StudyCase, frfs: FrfSet, outputs: Axis, inputs: Axis) -> FrfSet | None:
    """The measured functions on the request's outputs and inputs; None where there is none."""
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
