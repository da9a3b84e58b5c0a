"""Records of responses at one stage; their arrays go beside them by key."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from femtune.errors import Notice
from femtune.files.study_file import ResponseTable
from femtune.files.uff import force_unit
from femtune.modal import frac
from femtune.model import EigenSolution, ModelPoint
from femtune.model.without_damping import without_element_damping
from femtune.study.cases import StudyCase
from femtune.study.load import Study
from femtune.study.located import located, located_in_deck
from femtune.study.progress import Progress, silent
from femtune.study.record_correlation import array_prefix
from femtune.study.record_model import alert_of
from femtune.study.record_poles import listed_poles, pole_records, unstable
from femtune.study.record_static import static_results
from femtune.study.response_axes import same_motion
from femtune.study.response_request import ResponseRequest, response_request
from femtune.study.response_solver import Solve, solved_frfs
from femtune.study.results_base import Stage
from femtune.study.results_response import FrfPair, FrfResults, ResponseResults

Arrays = dict[str, NDArray]
Complexes = NDArray[np.complex128]

_PER_TIME = {"receptance": "", "mobility": "/s", "accelerance": "/s²"}
_SAME_LINE = 1e-6
_LEAST_LINES = 2
_SHOWN = 6
_ROUNDING = 1e-12


def response_results(
    study: Study,
    case: StudyCase,
    stage: Stage,
    x: NDArray[np.float64],
    number: int,
    arrays: Arrays,
    progress: Progress = silent,
) -> ResponseResults | None:
    """FRFs, complex modes and static displacements of a configuration; None where the study asks for none.

    Raises
    ------
    FemtuneError : ``response.*``, ``damping.*``, ``complex.*``, ``eigen.*``
    """
    table = study.file.response
    if table is None and not study.file.load:
        return None
    point = case.configured.at(x)
    found = ResponseResults(configuration=case.name, stage=stage)
    doing = partial(_say, progress, f"{case.name}, {stage}")
    if table is not None:
        request = response_request(study, case, table)
        key = f"{array_prefix(stage, case.name, number)}/frf"
        found = _with_frfs(study, request, point, found, key, arrays, doing)
    doing("static displacements")
    outputs = None if table is None else request.outputs
    return found.model_copy(update={"loads": static_results(study, case, point, outputs)})


def _say(progress: Progress, subject: str, doing: str, done: int = 0, total: int | None = None) -> None:
    progress.step(f"{subject}: {doing}", done, total)


def _with_frfs(
    study: Study,
    request: ResponseRequest,
    point: ModelPoint,
    found: ResponseResults,
    prefix: str,
    arrays: Arrays,
    doing: Callable[..., None],
) -> ResponseResults:
    point = without_element_damping(point) if request.table.damping == "modal" else point

    @cache
    def modes() -> EigenSolution:
        doing("modes")
        with located_in_deck(study.built.deck):
            return study.solver.modes(point, *request.modes)

    with located(study.file.where("response", *_about_damping(request.table))):
        way = "frequency lines, directly" if request.method == "direct" else f"responses by {request.table.method}"
        values = solved_frfs(study, request, point, modes, partial(doing, way))
    damping = damping_words(study, request, point)
    notices = request.notices if damping else (*request.notices, _undamped(request))
    doing("complex modes")
    poles, reason = listed_poles(study, request, point, modes, damped=bool(damping))
    notices = (*notices, *unstable(request, poles))
    parts = {
        "frfs": _frf_results(study, request, modes, values, damping, prefix, arrays),
        "poles": () if poles is None else pole_records(poles),
        "poles_reason": reason,
        "alerts": tuple(map(alert_of, notices)),
    }
    return found.model_copy(update=parts)


def _about_damping(table: ResponseTable) -> tuple[str, ...]:
    return ("ratios",) if table.ratios is not None else ()


def _undamped(request: ResponseRequest) -> Notice:
    what = (
        f"{request.case.name}: nothing damps the model, neither the deck nor [response], so its responses are real and "
        "without bound at natural frequencies; give ratio, for example 0.01"
    )
    return Notice("response.undamped", what)


def damping_words(study: Study, request: ResponseRequest, point: ModelPoint) -> str:
    """What damps a model point, in words; "" where nothing does."""
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
        words.append(f"modal damping of the deck (SDAMPING {study.built.deck.case_control.damping})")
    words += [_words_of_modes(point)] if point.mode_ratios else []
    return ", ".join(words)


def _words_of_modes(point: ModelPoint) -> str:
    """Ratios that are parameters."""
    found = [
        f"{float(r.value):.3g} of " + (f"mode {n}" if n else "others") for n, r in sorted(point.mode_ratios.items())
    ]
    return "updated damping ratios " + ", ".join(found[:_SHOWN]) + (" …" if len(found) > _SHOWN else "")


def _frf_results(
    study: Study, request: ResponseRequest, modes: Solve, values: Complexes, damping: str, prefix: str, arrays: Arrays
) -> FrfResults:
    table, measured = request.table, request.measured
    arrays |= {f"{prefix}_hz": request.freq_hz, f"{prefix}_values": values}
    if measured is not None:
        arrays |= {f"{prefix}_test_hz": measured.freq_hz, f"{prefix}_test_values": measured.values}
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
        pairs=tuple(_pairs(request, values)),
    )


def _unit(study: Study, table: ResponseTable) -> str:
    if not study.units_known:
        return ""
    units = study.file.study.unit_system
    force = force_unit(units)
    length = units.name.split("-", maxsplit=1)[0]
    return f"{length}{_PER_TIME[table.kind]}/{force if '/' not in force else f'({force})'}"


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
    found = {} if common is None else _beside(request, model, i, j, common)
    if found and abs(model[at]) <= floor:
        # how rounding compares says nothing
        found["frac"] = None
    return FrfPair(
        output=str(request.outputs.labels[i]), input=str(request.inputs.labels[j]), driving_point=driven,
        peak_hz=float(request.freq_hz[at]), peak=float(abs(model[at])), **found,
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
    same = np.flatnonzero(np.abs(b[near] - a) <= _SAME_LINE * a)
    return same, near[same]
