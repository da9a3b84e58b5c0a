"""Residuals of measured FRFs, from their [[residual]] tables: settled at the start of the update."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Notice, Where, did_you_mean
from femtune.files.study_file.residual_frf import AntiresonanceResidualEntry, FrfResidualEntry, MeasuredFunctionsTable
from femtune.modal import FrfSet, ModeSet
from femtune.model import ModalDamping, constant_damping, damping_by_mode
from femtune.model.response import Method
from femtune.residuals import (
    Band,
    FrfScatter,
    ModelWay,
    Places,
    ZeroGates,
    ZeroSearch,
    antiresonance_residual,
    frf_residual,
    measured_antiresonances,
)
from femtune.residuals.at_first_state import AtFirstState, Settled
from femtune.residuals.case import CaseState
from femtune.residuals.frf_lines import Lines
from femtune.residuals.model_way import ModesWanted, full_modes
from femtune.residuals.paired_resonances import PairedResonances
from femtune.study.cases import StudyCase
from femtune.study.located import located
from femtune.study.response_axes import sensor_axis

Placer = Callable[..., Where]

_METHODS: dict[str, Method] = {"real modes": "real-modes", "complex modes": "complex-modes", "direct": "direct"}
_USUAL_SD = 0.05


def frf_comparison(
    entry: FrfResidualEntry, case: StudyCase, where: Placer, deck_damping: ModalDamping | None, modes: ModeSet | None
) -> AtFirstState:
    """FRFs of the configuration's test, line by line.

    Raises
    ------
    FemtuneError : ``residual.no-frfs``, ``dof.missing``, ``residual.frf-scatter``, ``study.unknown-mode``
    """
    measured, places, notices = _functions(entry, case, where)
    _check_labels(entry, modes, where)
    relative = entry.sd if entry.sd is not None else (0.0 if entry.floor else _USUAL_SD)
    scatter = FrfScatter(relative, entry.floor, entry.averages)
    way = ModelWay(_METHODS[entry.method], _wanted(entry), _damping(entry, deck_damping), entry.residual_vectors)
    return _placed(partial(_settled_functions, entry, measured, places, scatter, way, notices), where)


def _placed(settle: Callable[[CaseState], Settled], where: Placer) -> AtFirstState:
    """What is settled at the start fails at its own table of the study, not at the first one."""

    def at_its_place(state: CaseState) -> Settled:
        with located(where()):
            return settle(state)

    return AtFirstState(at_its_place)


def _settled_functions(
    entry: FrfResidualEntry, measured: FrfSet, places: Places, scatter: FrfScatter, way: ModelWay,
    notices: tuple[Notice, ...], state: CaseState,
) -> Settled:  # fmt: skip
    lines, about_lines = _lines(entry, state)
    found, left = frf_residual(way.model(state), measured, lines, entry.form, scatter, way, places)
    return found, (*notices, *about_lines, *left)


def _lines(entry: FrfResidualEntry, state: CaseState) -> tuple[Lines, tuple[Notice, ...]]:
    if entry.around == "band":
        return Band(entry.from_hz, np.inf if entry.to_hz is None else entry.to_hz, entry.most), ()
    asked = PairedResonances(entry.modes, entry.region_ratio, entry.aligned, entry.bandwidths, entry.lines)
    return asked.found(state)


def antiresonance_comparison(entry: AntiresonanceResidualEntry, case: StudyCase, where: Placer) -> AtFirstState:
    """Antiresonances of the functions of the configuration's test.

    Raises
    ------
    FemtuneError : ``residual.no-frfs``, ``residual.no-antiresonances``, ``dof.missing``
    """
    measured, places, notices = _functions(entry, case, where)
    top = np.inf if entry.to_hz is None else entry.to_hz
    search = ZeroSearch(entry.from_hz, top, entry.half_width, entry.depth, entry.most_damping)
    zeros = measured_antiresonances(measured, search)
    gates = ZeroGates(entry.frequency_gate, entry.mac_gate)

    def settle(state: CaseState) -> Settled:
        wanted = _wanted(entry)
        modes = full_modes(state, wanted)
        found, left = antiresonance_residual(modes, measured, zeros, entry.sd, places, gates, wanted)  # type: ignore[arg-type]
        return found, (*notices, *left)

    return _placed(settle, where)


def _wanted(entry: MeasuredFunctionsTable) -> ModesWanted | None:
    return None if entry.count is None and entry.max_hz is None else (entry.count, entry.max_hz)


def _damping(entry: FrfResidualEntry, of_deck: ModalDamping | None) -> ModalDamping | None:
    if entry.ratio is not None:
        return constant_damping(entry.ratio)
    return of_deck if entry.ratios is None else damping_by_mode(entry.ratios)


def _check_labels(entry: FrfResidualEntry, modes: ModeSet | None, where: Placer) -> None:
    if entry.around == "resonances" and modes is None:
        raise FemtuneError(
            "study.no-test",
            "FRFs are compared around paired resonances, and the configuration has no test with modes",
            where=where("around"),
            hint="give the configuration a test with modes (data sets 55), or compare a band",
        )
    for i, label in enumerate(entry.modes or ()):
        assert modes is not None
        if label not in modes.labels:
            raise FemtuneError(
                "study.unknown-mode", f"no mode of the test is called '{label}'",
                where=where("modes", i), hint=did_you_mean(label, modes.labels),
            )  # fmt: skip


def _functions(
    entry: MeasuredFunctionsTable, case: StudyCase, where: Placer
) -> tuple[FrfSet, Places, tuple[Notice, ...]]:
    """The functions that are asked for and have a place in the model."""
    frfs = None if case.test is None else case.test.frfs
    if frfs is None:
        raise FemtuneError(
            "residual.no-frfs",
            f"configuration {case.name} has no measured FRFs, and this residual compares them",
            where=where(),
            hint='give the configuration test = "file.uff" with FRFs (data sets 58), or take the residual out',
        )
    outputs, about_outputs = sensor_axis(case, _named(entry.outputs, frfs.responses, where, "outputs"))
    inputs, about_inputs = sensor_axis(case, _named(entry.inputs, frfs.references, where, "inputs"))
    _check_some(case, outputs.labels, where, "outputs")
    _check_some(case, inputs.labels, where, "inputs")
    some = _select(frfs, outputs.labels, inputs.labels)
    return some, Places(outputs.rows, inputs.rows), tuple(dict.fromkeys((*about_outputs, *about_inputs)))


def _named(labels: Sequence[str] | None, measured: DofSet, where: Placer, key: str) -> DofSet:
    """Those of the test's functions that the study names, with the signs of the test."""
    if labels is None:
        return measured
    known = {(d.node, d.direction): d for d in measured}
    return DofSet(_known(known, parse_dof(label), where(key, i)) for i, label in enumerate(labels))


def _known(known: dict[tuple[int, str], Dof], dof: Dof, where: Where) -> Dof:
    if (dof.node, dof.direction) not in known:
        raise FemtuneError(
            "dof.missing",
            f"the test's FRFs have no {dof}",
            where=where,
            hint=did_you_mean(str(dof), map(str, known.values())),
        )
    return known[dof.node, dof.direction]


def _check_some(case: StudyCase, labels: Iterable[Any], where: Placer, key: str) -> None:
    if not list(labels):
        raise FemtuneError(
            "residual.no-frf-channels",
            f"configuration {case.name}: no FRF is left to compare: none of the {key} has a place in the model",
            where=where(),
            hint="check the nodes of the test, and [sensors]",
        )


def _select(frfs: FrfSet, responses: DofSet, references: DofSet) -> FrfSet:
    rows, _ = responses.align(frfs.responses)
    columns, _ = references.align(frfs.references)
    at = np.ix_(rows, columns)
    coherence = None if frfs.coherence is None else frfs.coherence[at]
    return replace(frfs, values=frfs.values[at], responses=responses, references=references, coherence=coherence)
