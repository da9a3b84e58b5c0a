"""Responses of one configuration, as records and arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError, Notice
from femtune.modal import fdac, frac, frequency_shift
from femtune.model.damping import without_element_damping
from femtune.model.response import matrix_ports
from femtune.model.response.modal_damping import is_proportional, may_be_negative
from femtune.steps.correlate.facts import array_prefix
from femtune.steps.info.facts import alert_of
from femtune.steps.modes.shapes import complex_mode_shapes, shape_rows
from femtune.steps.respond.identified_frfs import identified_frfs
from femtune.steps.respond.record import (
    ComplexPole,
    Displacement,
    FdacResults,
    FrfPair,
    FrfResults,
    ResponseResults,
    StaticResults,
)
from femtune.study.axes import named_axis, same_motion
from femtune.study.error_places import errors_at, errors_at_grid
from femtune.study.progress import silent
from femtune.study.record import ModelVersion
from femtune.study.response import response_request, solved_frfs, solved_poles, solved_static
from femtune.units import frf_unit

if TYPE_CHECKING:
    from femtune.arrays import Complexes
    from femtune.files.study_file import LoadEntry, ResponseTable
    from femtune.modal import FrfSet
    from femtune.model import ConfiguredModel, EigenSolution, ModelPoint
    from femtune.model.response import Ports
    from femtune.steps.modes.shapes import ShapeRows
    from femtune.study.axes import Axis
    from femtune.study.cases import StudyCase
    from femtune.study.progress import Progress
    from femtune.study.response import ComplexModeTable, ResponseRequest, Solve
    from femtune.study.study import Study


def listed_poles(
    study: Study, request: ResponseRequest, point: ModelPoint, modes: Solve, shown: ShapeRows, *, damped: bool
) -> tuple[ComplexModeTable | None, str]:
    """Complex modes, or the reason why there are none; their failure is no error if the FRFs do not need them."""
    if reason := _not_listed(request, point, modes, damped):
        return None, reason
    try:
        return solved_poles(study, request, point, modes, shown.matrix), ""
    except FemtuneError as error:
        if not error.code.startswith(("complex.", "response.defective")):
            raise
        return None, f"{error.what} ({error.code})"


def _not_listed(request: ResponseRequest, point: ModelPoint, modes: Solve, damped: bool) -> str:
    """The reason why complex modes are not listed; "" if they are."""
    if not damped:
        return "the model has no damping"
    if point.depends_on_frequency:
        return "stiffness or damping depends on frequency"
    if _may_grow(request, point):
        return ""
    if not np.any(point.viscous.data) and not np.any(point.hysteretic.data):
        return "with modal damping, they are identical to the real modes"
    if request.method == "direct":
        return 'they are only computed by the methods "real modes" and "complex modes"'
    if request.method == "real-modes" and is_proportional(modes()):
        return "damping is proportional, so that their shapes are those of the real modes"
    return ""


def _may_grow(request: ResponseRequest, point: ModelPoint) -> bool:
    """Negative damping has no frequency response by any method; only the poles show it."""
    return may_be_negative(point) or (request.damping is not None and bool((request.damping.values < 0.0).any()))


def unstable(request: ResponseRequest, poles: ComplexModeTable | None) -> tuple[Notice, ...]:
    """The notice on unstable modes."""
    growing = (
        [] if poles is None else [f"{f:.6g}" for f, z in zip(poles.freq_hz, poles.damping_ratio) if z < -_ROUNDING]
    )
    if not growing:
        return ()
    more = f" and {len(growing) - _MOST_LISTED} more" if len(growing) > _MOST_LISTED else ""
    return (
        Notice(
            "response.unstable",
            configuration=request.case.name,
            frequencies=", ".join(growing[:_MOST_LISTED]),
            more=more,
        ),
    )


def pole_records(table: ComplexModeTable) -> tuple[ComplexPole, ...]:
    """A record of each complex mode."""
    columns = zip(table.kind_words(), table.freq_hz, table.damping_ratio, table.phase_collinearity,
                  table.real_mode, table.real_freq_hz)  # fmt: skip
    return tuple(
        ComplexPole(
            kind=kind, freq_hz=float(f), damping_ratio=float(z) if np.isfinite(z) else None, real_mode=int(mode) + 1,
            phase_collinearity=min(1.0, float(c)), real_freq_hz=float(natural),
        )
        for kind, f, z, c, mode, natural in columns
    )  # fmt: skip


def static_results(study: Study, case: StudyCase, point: ModelPoint, default: Axis | None) -> tuple[StaticResults, ...]:
    """Displacements under every [[load]], all with one factorisation.

    Parameters
    ----------
    default : outputs of a load that names none; None for the DOFs that it drives

    Raises
    ------
    FemtuneError : ``response.static-free``, ``response.zero-load``, ``response.held-port``, ``model.unknown-node``,
        ``model.component``
    """
    file, loads = study.file, study.file.load
    if not loads:
        return ()
    forces = [named_axis(file, case, tuple(load.forces), "load", k, "forces") for k, load in enumerate(loads)]
    outputs = [_outputs(study, case, k, default, forces[k]) for k in range(len(loads))]
    _check_loads(study, forces)
    with errors_at(file.where("load")):
        ports = _ports(case.configured, loads, forces, outputs)
        values, relief = solved_static(study, point, ports)
    ends = np.cumsum([len(axis.labels) for axis in outputs])
    parts = [values[end - len(axis.labels) : end, k] for k, (axis, end) in enumerate(zip(outputs, ends))]
    return tuple(_record(load, axis, part, relief) for load, axis, part in zip(loads, outputs, parts))


def _outputs(study: Study, case: StudyCase, k: int, default: Axis | None, forces: Axis) -> Axis:
    load = study.file.load[k]
    if load.outputs is not None:
        return named_axis(study.file, case, load.outputs, "load", k, "outputs")
    return forces if default is None else default


def _check_loads(study: Study, forces: Sequence[Axis]) -> None:
    for k, (load, axis) in enumerate(zip(study.file.load, forces)):
        if not np.any(_row(load, axis).data):
            raise FemtuneError("response.zero-load", where=study.file.where("load", k, "forces"), load=load.name)


def _row(load: LoadEntry, axis: Axis) -> sp.csr_array:
    """(1, n_g) forces of a load."""
    return sp.csr_array(sp.csr_array(np.array([list(load.forces.values())])) @ axis.rows)


def _ports(
    configured: ConfiguredModel, loads: Sequence[LoadEntry], forces: Sequence[Axis], outputs: Sequence[Axis]
) -> Ports:
    cases = [_row(load, axis) for load, axis in zip(loads, forces)]
    seen = sp.csr_array(sp.vstack([axis.rows for axis in outputs]))
    names = tuple(load.name for load in loads)
    return matrix_ports(
        configured, sp.csr_array(sp.vstack(cases)), seen, _numbered(len(loads)), _numbered(seen.shape[0]), names
    )


def _numbered(count: int) -> DofSet:
    """Labels for combinations that are not a single DOF; names and order distinguish them."""
    return DofSet(Dof(k + 1, "S") for k in range(count))


def _record(load: LoadEntry, axis: Axis, values: NDArray[np.float64], relief: bool) -> StaticResults:
    moved = (Displacement(output=str(dof), value=float(value)) for dof, value in zip(axis.labels, values))
    forces = tuple(f"{label} {force:g}" for label, force in load.forces.items())
    return StaticResults(load=load.name, forces=forces, inertia_relief=relief, displacements=tuple(moved))


Arrays = dict[str, NDArray]


_LINE_TOLERANCE = 1e-6
"""Relative difference of two frequencies up to which they are the same line: frequencies in files have few digits."""


_LEAST_LINES = 2
"""Common lines from which the FRAC is computed: with one line it is always one."""


_MOST_LISTED = 6
"""Frequencies or damping ratios that a notice lists, so that it stays one sentence."""


_ROUNDING = 1e-12
"""Functions, or negative damping ratios, up to this magnitude (functions.

Relative to the largest) are zero except for rounding.
"""


def response_results(
    study: Study,
    case: StudyCase,
    version: ModelVersion,
    x: NDArray[np.float64],
    number: int,
    arrays: Arrays,
    progress: Progress = silent,
) -> ResponseResults | None:
    """FRFs, complex modes and static displacements of a configuration; None if none are requested.

    Raises
    ------
    FemtuneError : ``response.*``, ``damping.*``, ``complex.*``, ``eigen.*``
    """
    table = study.file.response
    if table is None and not study.file.load:
        return None
    point = case.configured.at(x)
    record = ResponseResults(configuration=case.name, stage=version)
    doing = partial(_say, progress, f"{case.name}, {version}")
    if table is not None:
        request = response_request(study, case, table)
        key = f"{array_prefix(version, case.name, number)}/frf"
        record = _with_frfs(study, request, point, record, key, arrays, doing)
    doing("static displacements")
    outputs = None if table is None else request.outputs
    return record.model_copy(update={"loads": static_results(study, case, point, outputs)})


def _say(progress: Progress, subject: str, doing: str, done: int = 0, total: int | None = None) -> None:
    progress.step(f"{subject}: {doing}", done, total)


def _with_frfs(
    study: Study,
    request: ResponseRequest,
    point: ModelPoint,
    record: ResponseResults,
    prefix: str,
    arrays: Arrays,
    doing: Callable[..., None],
) -> ResponseResults:
    point = without_element_damping(point) if request.table.damping == "modal" else point

    @cache
    def modes() -> EigenSolution:
        doing("modes")
        with errors_at_grid(study.built):
            return study.solver.modes(point, *request.modes)

    with errors_at(study.file.where("response", *_about_damping(request.table))):
        way = "frequency lines, directly" if request.method == "direct" else f"responses by {request.table.method}"
        values, error = solved_frfs(study, request, point, modes, partial(doing, way))
    # whether anything damps the model is the same at every frequency
    some = point.at_frequency(float(request.freq_hz[-1])) if point.depends_on_frequency else point
    damping = damping_words(study, request, some)
    notices = request.notices if damping else (*request.notices, _undamped(request))
    notices = (*notices, *_truncated(request, error))
    doing("complex modes")
    shown = shape_rows(request.case)
    poles, reason = listed_poles(study, request, point, modes, shown, damped=bool(damping))
    case, stage = request.case, record.stage
    shapes = None if poles is None else complex_mode_shapes(case, stage, shown, poles.motion, prefix, arrays)
    notices = (*notices, *unstable(request, poles))
    parts = {
        "frfs": _frf_results(study, request, modes, values, damping, prefix, arrays).model_copy(
            update={"truncation_error": error}
        ),
        "poles": () if poles is None else pole_records(poles),
        "poles_reason": reason,
        "pole_shapes": shapes,
        "alerts": tuple(map(alert_of, notices)),
    }
    return record.model_copy(update=parts)


def _about_damping(table: ResponseTable) -> tuple[str, ...]:
    return ("ratios",) if table.ratios is not None else ()


_LARGE_TRUNCATION = 1e-3
"""Relative error of functions by truncation of the modes above which a notice is given.

It is smaller than errors of measured functions.
"""


def _truncated(request: ResponseRequest, error: float | None) -> tuple[Notice, ...]:
    """A notice where modes are missing that the functions need."""
    if error is None or error <= _LARGE_TRUNCATION:
        return ()
    code = "response.truncated" if request.limit else "response.truncated/default"
    return (Notice(code, configuration=request.case.name, percent=100.0 * error, limit=request.limit),)


def _undamped(request: ResponseRequest) -> Notice:
    return Notice("response.undamped", configuration=request.case.name)


def damping_words(study: Study, request: ResponseRequest, point: ModelPoint) -> str:
    """The damping at a model point, in words; "" without damping."""
    table, words = request.table, []
    if np.any(point.hysteretic.data):
        words.append("loss factors of the deck")
    if np.any(point.viscous.data):
        words.append("dashpots of the deck")
    if table.ratio is not None or table.ratios is not None:
        given = table.ratios or (table.ratio or 0.0,)
        span = f"{given[0]:g}" if min(given) == max(given) else f"{min(given):g} to {max(given):g}"
        words += [f"modal damping ratio {span}"] if any(given) else []
    elif request.damping is not None:
        words.append(f"modal damping of the deck (SDAMPING {study.built.damping_number})")
    words += [_words_of_modes(point)] if point.mode_ratios else []
    return ", ".join(words)


def _words_of_modes(point: ModelPoint) -> str:
    """Ratios that are parameters."""
    ratios = [
        f"{float(r.value):.3g} of " + (f"mode {n}" if n else "others") for n, r in sorted(point.mode_ratios.items())
    ]
    return "updated damping ratios " + ", ".join(ratios[:_MOST_LISTED]) + (" …" if len(ratios) > _MOST_LISTED else "")


def _frf_results(
    study: Study, request: ResponseRequest, modes: Solve, values: Complexes, damping: str, prefix: str, arrays: Arrays
) -> FrfResults:
    table, measured = request.table, request.measured
    arrays |= {f"{prefix}_hz": request.freq_hz, f"{prefix}_values": values}
    identified = None
    if measured is not None:
        arrays |= {f"{prefix}_test_hz": measured.freq_hz, f"{prefix}_test_values": measured.values}
        identified = identified_frfs(measured, None if request.case.test is None else request.case.test.modes)
    if identified is not None:
        arrays |= dict(zip((f"{prefix}_identified_hz", f"{prefix}_identified_values"), identified))
    return FrfResults(
        kind=table.kind,
        unit=_unit(study, table),
        method=table.method,
        modes=modes().wanted if request.needs_modes else None,
        residual_vectors=table.residual_vectors and table.method != "direct",
        damping=damping,
        outputs=tuple(request.outputs.labels.labels()),
        inputs=tuple(request.inputs.labels.labels()),
        freq_key=f"{prefix}_hz",
        values_key=f"{prefix}_values",
        test_freq_key=None if measured is None else f"{prefix}_test_hz",
        test_values_key=None if measured is None else f"{prefix}_test_values",
        identified_freq_key=None if identified is None else f"{prefix}_identified_hz",
        identified_values_key=None if identified is None else f"{prefix}_identified_values",
        pairs=tuple(_pairs(request, values)),
        fdac=() if measured is None else tuple(_fdac(request, measured, values, prefix, arrays)),
    )


_MOST_FDAC_LINES = 400
"""Lines of each side of the FDAC; of more, every n-th is used. It is a picture, whose pixels are not finer."""


def _fdac(
    request: ResponseRequest, measured: FrfSet, values: Complexes, prefix: str, arrays: Arrays
) -> Iterator[FdacResults]:
    """By input where several responses were measured, else by output."""
    model_hz = request.freq_hz
    inside = (measured.freq_hz >= model_hz[0]) & (measured.freq_hz <= model_hz[-1]) & (measured.freq_hz > 0.0)
    test_at, model_at = _every(np.flatnonzero(inside)), _every(np.flatnonzero(model_hz > 0.0))
    if not len(test_at) or not len(model_at):
        return
    test, model = measured.values[:, :, test_at], values[:, :, model_at]
    known: NDArray[np.bool_] = np.asarray(np.isfinite(test).any(axis=2))
    by_input = (known.sum(axis=0) >= _LEAST_FUNCTIONS).any()
    if not by_input:
        test, model, known = test.transpose(1, 0, 2), model.transpose(1, 0, 2), known.T
    labels = (request.inputs if by_input else request.outputs).labels
    for j in map(int, np.flatnonzero(known.sum(axis=0) >= _LEAST_FUNCTIONS)):
        key = f"{prefix}_fdac_{j + 1}"
        correlation = fdac(test[known[:, j], j], model[known[:, j], j])
        shift = frequency_shift(correlation, measured.freq_hz[test_at], model_hz[model_at])
        arrays |= {key: correlation, f"{key}_test_hz": measured.freq_hz[test_at], f"{key}_hz": model_hz[model_at]}
        yield FdacResults(
            axis="input" if by_input else "output",
            dof=str(labels[j]),
            functions=int(known[:, j].sum()),
            mean=None if shift is None else _or_none(shift.mean_unshifted),
            shift_percent=None if shift is None else _or_none(100.0 * (shift.ratio - 1.0)),
            mean_shifted=None if shift is None else _or_none(shift.mean),
            values_key=key,
            test_freq_key=f"{key}_test_hz",
            model_freq_key=f"{key}_hz",
        )


def _or_none(value: float) -> float | None:
    return None if np.isnan(value) else value


_LEAST_FUNCTIONS = 2
"""Functions of an input from which the FDAC is computed: that of a single function is always one."""


def _every(positions: NDArray[np.int64]) -> NDArray[np.int64]:
    return positions[:: -(-len(positions) // _MOST_FDAC_LINES) or 1]


def _unit(study: Study, table: ResponseTable) -> str:
    return frf_unit(table.kind, study.file.study.unit_system) if study.units_known else ""


def _pairs(request: ResponseRequest, values: Complexes) -> list[FrfPair]:
    driven = same_motion(request.outputs.rows, request.inputs.rows) != 0.0
    places = [(i, j) for j in range(values.shape[1]) for i in range(values.shape[0])]
    common = None if request.measured is None else _common_lines(request.freq_hz, request.measured.freq_hz)
    floor = _ROUNDING * float(np.abs(values).max(initial=0.0))
    return [_pair(request, values[i, j], i, j, bool(driven[i, j]), common, floor) for i, j in places]


def _pair(
    request: ResponseRequest,
    model: Complexes,
    i: int,
    j: int,
    driven: bool,
    common: tuple[NDArray, NDArray] | None,
    floor: float,
) -> FrfPair:
    at = int(np.argmax(np.abs(model)))
    comparison = {} if common is None else _beside(request, model, i, j, common)
    if comparison and abs(model[at]) <= floor:
        # how rounding compares says nothing
        comparison["frac"] = None
    return FrfPair(
        output=str(request.outputs.labels[i]), input=str(request.inputs.labels[j]), driving_point=driven,
        peak_hz=float(request.freq_hz[at]), peak=float(abs(model[at])), **comparison,
    )  # fmt: skip


def _beside(
    request: ResponseRequest, model: Complexes, i: int, j: int, common: tuple[NDArray, NDArray]
) -> dict[str, float | None]:
    """Peak of the measured function within the model's lines, and the FRAC."""
    assert request.measured is not None
    lines, test = request.measured.freq_hz, request.measured.values[i, j]
    inside = (lines >= request.freq_hz[0]) & (lines <= request.freq_hz[-1]) & np.isfinite(test)
    if not inside.any():
        return {}
    at = int(np.argmax(np.where(inside, np.abs(test), -1.0)))
    here, there = common
    both = frac(model[here], test[there]) if len(here) >= _LEAST_LINES else None
    return {"test_peak_hz": float(lines[at]), "test_peak": float(abs(test[at])), "frac": both}


def _common_lines(a: NDArray, b: NDArray) -> tuple[NDArray, NDArray]:
    """Positions of the lines that both have."""
    right = np.clip(np.searchsorted(b, a), 1, max(len(b) - 1, 1))
    left = right - 1
    right = np.minimum(right, len(b) - 1)
    near = np.where(np.abs(b[left] - a) <= np.abs(b[right] - a), left, right)
    same = np.flatnonzero(np.abs(b[near] - a) <= _LINE_TOLERANCE * a)
    return same, near[same]
