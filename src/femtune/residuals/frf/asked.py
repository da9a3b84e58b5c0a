"""Residuals of measured FRFs that a study requests; they are settled at the start of the update."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, Notice, Where, did_you_mean
from femtune.identification import EqualisedTest
from femtune.identification.redrawn import RedrawnTest
from femtune.modal import FrfSet, ModeSet
from femtune.model import ModalDamping, ModelPoint, constant_damping, damping_by_mode
from femtune.model.kinds import FRF_METHODS
from femtune.model.response import TIMES_HIGHEST_LINE
from femtune.model.response.rigid import is_rigid
from femtune.residuals.asked import Asked
from femtune.residuals.case import CaseState
from femtune.residuals.frf.against_model import against_model
from femtune.residuals.frf.antiresonance import AntiresonanceResidual, ZeroGates, antiresonance_residual
from femtune.residuals.frf.choice import frf_residual
from femtune.residuals.frf.equalised import equal_damping, weighted_by_identification
from femtune.residuals.frf.left_out import LeftOutModes, left_out_modes
from femtune.residuals.frf.lines import Band, Lines, PairedResonances
from femtune.residuals.frf.measured_zeros import ZeroSearch, found_antiresonances
from femtune.residuals.frf.model_way import AtFirstState, ModelWay, ModesWanted, Settled, full_modes
from femtune.residuals.frf.raw import raw_residual
from femtune.residuals.frf.residual import FrfResidual, Places
from femtune.residuals.frf.scatter import FrfScatter, relative_sd
from femtune.residuals.frf.truncation import with_enough_modes

_TOGETHER = 10.0
"""Root of the number of values whose common error counts as much as that of one: parameters follow the sum of errors of
one sign, and a tenth of the noise of single values is too much for thousands of them."""
_POOR = 0.1
"""Relative error of an identified system above which modes may be missing in it."""


@dataclass(frozen=True, eq=False)
class AskedFrfs(AtFirstState):
    """FRFs of the test of a configuration that a study requests; settled at the start of the update.

    Parameters
    ----------
    raw : of an identified test: the settled comparison, that test, a state and damping of the model's modes -> the
        comparison of the measured FRFs themselves, see `raw_residual`
    check_left_out : state at the initial values -> nothing; error ``residual.left-out-mode`` where the table leaves out
        a mode that the model does not have. Solves for modes about the frequencies in the table only
    """

    raw: Callable[[FrfResidual, RedrawnTest, CaseState, ModalDamping], FrfResidual] | None = field(
        default=None, repr=False
    )
    check_left_out: Callable[[CaseState], None] = field(default=lambda state: None, repr=False)
    key = FrfResidual.key
    label = FrfResidual.label

    @classmethod
    def of_study(cls, asked: Asked) -> AskedFrfs:
        """See `Residual`; errors ``residual.no-frfs``, ``residual.frf-scatter``, ``dof.missing`` …"""
        entry = asked.entry
        measured, places, notices = _functions(asked)
        _check_labels(asked)
        relative = relative_sd(entry.sd, entry.floor)
        scatter = FrfScatter(relative, entry.floor, entry.averages, _output_sd(asked, measured), _angles(entry))
        way = ModelWay(FRF_METHODS[entry.method], _wanted(entry), None, entry.residual_vectors, _limit(entry))
        if asked.decay and entry.around == "resonances" and entry.aligned:
            raise FemtuneError("residual.window-aligned", where=asked.where("aligned"), configuration=asked.name)

        def settle(state: CaseState) -> Settled:
            test = asked.equalised(lambda frfs: _rigid_body(asked, state, frfs))
            used, damping, about = _equalised(asked, measured, test)
            about = (*_window(asked), *about)
            # the window is taken out of identified functions
            way_of = replace(way, damping=damping, decay=asked.decay if test is None else 0.0)
            residual, told = _settled_functions(entry, used, places, scatter, way_of, (*notices, *about), state)
            if test is None:
                return residual, (*told, *undamped(asked.name, state.full, damping))
            # lines of an identified test are free of the noise of single lines, which would bias their weights
            residual, lost = weighted_by_identification(replace(residual, identified=test.redrawn, shift=None))
            return residual, (*told, *lost)

        def raw(residual: FrfResidual, identified: RedrawnTest, state: CaseState, damping: ModalDamping) -> FrfResidual:
            test = asked.equalised()
            assert test is not None
            lines = _lines(entry, state)[0]
            found = raw_residual(residual, identified, measured, lines, scatter, damping, test.left_out_hz)
            assert found.noise is not None
            # what is small beside the stated standard deviations may be large beside the noise of all lines together
            values = 2 * int(np.isfinite(found.sd).sum())
            least = found.sd * found.noise * min(1.0, _TOGETHER / np.sqrt(max(values, 1)))
            enough, _ = with_enough_modes(replace(found, sd=least, noise=None), state)
            return replace(found, way=enough.way)

        def check_left_out(state: CaseState) -> None:
            if entry.leave_out_modes_hz:
                # an error names those next to a frequency, which may be above it
                top = None, TIMES_HIGHEST_LINE * max(entry.leave_out_modes_hz)
                with asked.errors_at():
                    _left_out(entry, state, replace(way, modes=way.modes or top))

        return cls(
            _placed(settle, asked), lambda low, high: cls.of_study(asked.in_band(low, high)), raw=raw,
            check_left_out=check_left_out,
        )  # fmt: skip


class AskedAntiresonances(AtFirstState):
    """Antiresonances of these FRFs, settled in the same way."""

    key = AntiresonanceResidual.key
    label = AntiresonanceResidual.label

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return True

    @classmethod
    def of_study(cls, asked: Asked) -> AskedAntiresonances:
        """See `Residual`; errors ``residual.no-frfs``, ``residual.no-antiresonances``, ``dof.missing``."""
        entry = asked.entry
        measured, places, notices = _functions(asked)
        top = np.inf if entry.to_hz is None else entry.to_hz
        search = ZeroSearch(
            entry.from_hz, top, entry.half_width, entry.depth, entry.most_damping, entry.above_noise, asked.decay
        )
        in_test = found_antiresonances(measured, search)
        zeros, count = in_test.zeros, in_test.in_noise
        if count:
            level = entry.above_noise
            notices = (
                *notices,
                Notice("residual.antiresonances-in-noise", configuration=asked.name, count=count, ratio=level),
            )
        gates = ZeroGates(entry.frequency_gate, entry.mac_gate)

        def settle(state: CaseState) -> Settled:
            highest_hz = max((z.freq_hz for z in zeros), default=0.0)
            wanted = ModelWay(modes=_wanted(entry)).settled(state, highest_hz).modes
            modes = full_modes(state, wanted)
            residual, left = antiresonance_residual(modes, measured, zeros, entry.sd, places, gates, wanted)
            return residual, (*notices, *left)

        return cls(_placed(settle, asked), lambda low, high: cls.of_study(asked.in_band(low, high)))


def _window(asked: Asked) -> tuple[Notice, ...]:
    """What is known of the window of the measured FRFs."""
    if not asked.decay:
        return ()
    return (Notice("residual.frf-window", level="info", configuration=asked.name, seconds=1.0 / asked.decay),)


def _rigid_body(asked: Asked, state: CaseState, frfs: FrfSet) -> ModeSet:
    """Rigid-body modes of the model at the channels of functions (errors ``residual.rigid-body``)."""
    outputs, seen, _ = asked.seen(frfs.responses)
    inputs, driven, _ = asked.seen(frfs.references)
    lost = [str(d) for of, some in ((frfs.responses, outputs), (frfs.references, inputs)) for d in of if d not in some]
    if lost:
        names = ", ".join(dict.fromkeys(lost))
        raise FemtuneError("residual.rigid-body/channels", configuration=asked.name, names=names)
    modes = full_modes(state, None)
    rigid = np.flatnonzero(is_rigid(modes)[: modes.wanted])
    if not len(rigid):
        raise FemtuneError("residual.rigid-body", configuration=asked.name)
    known: dict[tuple[int, str], int] = {}
    for k, dof in enumerate((*outputs, *inputs)):
        known.setdefault((dof.node, dof.direction), k)
    dofs = DofSet((*outputs, *inputs)[k] for k in known.values())
    ports = Places(seen, driven).ports(modes.point.configured, replace(frfs, responses=outputs, references=inputs))
    rows = np.vstack([ports.outputs @ modes.shapes[:, rigid], ports.inputs.T @ modes.shapes[:, rigid]])
    return ModeSet(np.zeros(len(rigid)), np.asarray(rows[list(known.values())]), dofs, normalisation="mass")


def _equalised(
    asked: Asked, measured: FrfSet, equalised: EqualisedTest | None
) -> tuple[FrfSet, ModalDamping | None, tuple[Notice, ...]]:
    """The functions and the modal damping of the model, both with one damping ratio if the study requests it."""
    entry = asked.entry
    if equalised is None:
        return measured, stated_damping(entry, asked.damping), ()
    zeta = equalised.moved.damping_ratio
    notice = Notice(
        "residual.equalised", level="info", configuration=asked.name, ratio=equalised.damping_ratio,
        low=equalised.band_hz[0], high=equalised.band_hz[1], modes=len(zeta), least=100.0 * zeta.min(initial=1.0),
        most=100.0 * zeta.max(initial=0.0), lines=len(equalised.frfs.freq_hz), misfit=100.0 * equalised.misfit,
        left_out=_bands(equalised.left_out_hz), outside=100.0 * equalised.outside_ratio,
    )  # fmt: skip
    told = [notice, *equalised.identified.notices]
    if equalised.misfit > _POOR:
        told.append(
            Notice(
                "residual.equalised-poor", configuration=asked.name, misfit=100.0 * equalised.misfit, modes=len(zeta),
                order=equalised.largest_order,
            )
        )  # fmt: skip
    return (
        _select(equalised.frfs, measured.responses, measured.references),
        equal_damping(equalised.damping_ratio, equalised.band_hz, equalised.outside_ratio),
        tuple(told),
    )


def _bands(left_out: Sequence[tuple[float, float]]) -> str:
    """Bands that are not compared, in words."""
    return "".join(f", without {low:g} to {high:g} Hz" for low, high in left_out)


def _placed(settle: Callable[[CaseState], Settled], asked: Asked) -> Callable[[CaseState], Settled]:
    """Errors at the start of the update point to the table of this residual, not to the first one."""

    def at_its_place(state: CaseState) -> Settled:
        with asked.errors_at():
            return settle(state)

    return at_its_place


def undamped(configuration: str, point: ModelPoint, damping: ModalDamping | None) -> tuple[Notice, ...]:
    """A warning if nothing damps the functions of a model: they are infinite at its resonances."""
    if damping is not None or point.mode_ratios or point.depends_on_frequency:
        return ()
    if any(np.abs(matrix.data).max(initial=0.0) > 0.0 for matrix in (point.viscous, point.hysteretic)):
        return ()
    return (Notice("residual.frf-undamped", configuration=configuration),)


def _settled_functions(
    entry: Any, measured: FrfSet, places: Places, scatter: FrfScatter, way: ModelWay,
    notices: tuple[Notice, ...], state: CaseState,
) -> tuple[FrfResidual, tuple[Notice, ...]]:  # fmt: skip
    lines, about_lines = _lines(entry, state)
    highest_hz = max(float(measured.freq_hz[r.at].max()) * r.stretch for r in lines.regions(measured.freq_hz))
    way = way.settled(state, highest_hz)
    model = way.model(state, highest_hz)
    residual, left = frf_residual(model, measured, lines, entry.form, scatter, way, places)
    left_out = _left_out(entry, state, way)
    residual = replace(residual, left_out=left_out)
    told = () if left_out is None else (_told_left_out(left_out, state.case.name),)
    doubts = against_model(residual.measured, residual.survey(model), np.isfinite(residual.sd), residual.configuration)
    residual, times = with_enough_modes(residual, state)
    return residual, (
        *notices,
        *told,
        *about_lines,
        *_more_modes(state, residual.way, highest_hz, times),
        *left,
        *doubts,
    )


def _left_out(entry: Any, state: CaseState, way: ModelWay) -> LeftOutModes | None:
    """The modes that the table leaves out, named by their frequencies at the initial values (error
    ``residual.left-out-mode``)."""
    if not entry.leave_out_modes_hz:
        return None
    if np.any(state.point.x):
        # a later stage begins elsewhere
        case = state.case.on_full_model
        state = CaseState(case, case.configured.at(np.zeros(len(state.point.x))))
    return left_out_modes(full_modes(state, way.modes), entry.leave_out_modes_hz, state.case.name)


def _told_left_out(left_out: LeftOutModes, configuration: str) -> Notice:
    named = [f"{1 + number} ({hz:.4g} Hz)" for number, hz in zip(left_out.numbers, left_out.freq_hz)]
    which = f"model mode {named[0]} is" if len(named) == 1 else f"model modes {', '.join(named)} are"
    return Notice("residual.frf-left-out-modes", level="info", configuration=configuration, modes=which)


def _more_modes(state: CaseState, way: ModelWay, highest_hz: float, times: float) -> tuple[Notice, ...]:
    """Says so where [modes] has fewer modes than the lines need."""
    case = state.case
    # [modes] has one of the two keys; without it both may be set, or none
    stated = (case.count is None) != (case.max_hz is None)
    if way.limit or way.modes is None or way.modes == (case.count, case.max_hz) or not stated:
        return ()
    few = f"count = {case.count}" if case.max_hz is None else f"max_hz = {case.max_hz:g}"
    return (
        Notice(
            "residual.frf-more-modes",
            level="info",
            configuration=case.name,
            few=few,
            modes=way.modes[0],
            times=times,
            highest_hz=highest_hz,
        ),
    )


def _lines(entry: Any, state: CaseState) -> tuple[Lines, tuple[Notice, ...]]:
    if entry.around == "band":
        return Band(entry.from_hz, np.inf if entry.to_hz is None else entry.to_hz, entry.most), ()
    asked = PairedResonances(entry.modes, entry.region_ratio, entry.aligned, entry.bandwidths, entry.lines)
    return asked.found(state)


def _wanted(entry: Any) -> ModesWanted | None:
    return None if entry.count is None and entry.max_hz is None else (entry.count, entry.max_hz)


def _output_sd(asked: Asked, measured: FrfSet) -> dict[tuple[int, str], float]:
    """Relative standard deviations of single outputs (error ``dof.missing``)."""
    known = {(d.node, d.direction): d for d in measured.responses}
    sd_of_outputs = {}
    for label, sd in (asked.entry.output_sd or {}).items():
        dof = _known(known, parse_dof(label), asked.where("output_sd"))
        sd_of_outputs[dof.node, dof.direction] = float(sd)
    return sd_of_outputs


def _angles(entry: Any) -> dict[int, float]:
    """Standard deviations of the rotation of sensors, rad, by node; 0 stands for all."""
    given = entry.angle_sd_deg if isinstance(entry.angle_sd_deg, dict) else {0: entry.angle_sd_deg}
    return {int(node): float(np.deg2rad(angle)) for node, angle in given.items() if angle}


def _limit(entry: Any) -> str:
    """The key that limits the number of modes."""
    if entry.count is not None:
        return f"count = {entry.count:g}"
    return "" if entry.max_hz is None else f"max_hz = {entry.max_hz:g}"


def stated_damping(entry: Any, of_deck: ModalDamping | None) -> ModalDamping | None:
    """Modal damping of a table of FRFs, else that of the deck."""
    if entry.ratio is not None:
        return constant_damping(entry.ratio)
    return of_deck if entry.ratios is None else damping_by_mode(entry.ratios)


def _check_labels(asked: Asked) -> None:
    entry, modes = asked.entry, asked.tested
    if entry.around == "resonances" and modes is None:
        raise FemtuneError("study.no-test/around-resonances", where=asked.where("around"))
    for i, label in enumerate(entry.modes or ()):
        assert modes is not None
        if label not in modes.labels:
            raise FemtuneError(
                "study.unknown-mode/frf-residual",
                where=asked.where("modes", i),
                hint=did_you_mean(label, modes.labels),
                label=label,
            )


def _functions(asked: Asked) -> tuple[FrfSet, Places, tuple[Notice, ...]]:
    """The functions that are requested and have a place in the model."""
    entry, frfs = asked.entry, asked.frfs
    if frfs is None:
        raise FemtuneError("residual.no-frfs", where=asked.where(), configuration=asked.name)
    outputs, seen, about_outputs = asked.seen(_named(asked, entry.outputs, frfs.responses, "outputs"))
    inputs, driven, about_inputs = asked.seen(_named(asked, entry.inputs, frfs.references, "inputs"))
    _check_some(asked, outputs, "outputs")
    _check_some(asked, inputs, "inputs")
    return _select(frfs, outputs, inputs), Places(seen, driven), tuple(dict.fromkeys((*about_outputs, *about_inputs)))


def _named(asked: Asked, labels: Sequence[str] | None, measured: DofSet, key: str) -> DofSet:
    """Those of the test's functions that the study names, with the signs of the test."""
    if labels is None:
        return measured
    known = {(d.node, d.direction): d for d in measured}
    return DofSet(_known(known, parse_dof(label), asked.where(key, i)) for i, label in enumerate(labels))


def _known(known: dict[tuple[int, str], Dof], dof: Dof, where: Where) -> Dof:
    if (dof.node, dof.direction) not in known:
        raise FemtuneError(
            "dof.missing/in-frfs", where=where, hint=did_you_mean(str(dof), map(str, known.values())), dof=dof
        )
    return known[dof.node, dof.direction]


def _check_some(asked: Asked, labels: DofSet, key: str) -> None:
    if not len(labels):
        raise FemtuneError(
            "residual.no-frf-channels/not-in-model", where=asked.where(), configuration=asked.name, key=key
        )


def _select(frfs: FrfSet, responses: DofSet, references: DofSet) -> FrfSet:
    rows, _ = responses.align(frfs.responses)
    columns, _ = references.align(frfs.references)
    at = np.ix_(rows, columns)
    coherence = None if frfs.coherence is None else frfs.coherence[at]
    return replace(frfs, values=frfs.values[at], responses=responses, references=references, coherence=coherence)
