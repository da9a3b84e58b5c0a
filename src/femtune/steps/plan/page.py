"""A planned test: key numbers, sensors on the structure, target modes, and how the sensors were placed."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import (
    AlertBox,
    Cell,
    Figure,
    Heading,
    KeyNumber,
    KeyNumbers,
    Listing,
    Paragraph,
    Section,
    Table,
    columns,
    row,
)
from femtune.document.figures.matrix import SIDE_BY_SIDE, MatrixPicture, matrix_svg
from femtune.document.figures.sensors import Marks, sensors_svg
from femtune.document.numbers import NONE, counted, freq, listed, short, signed_percent, unit_fraction, value, with_unit
from femtune.planning.kinds import CRITERIA, PLACEMENT_METHODS, WEIGHTINGS
from femtune.residuals.kinds import FRF_FORMS
from femtune.steps.modes.page.mode_shapes import structure_of
from femtune.steps.run.page.basis import basis

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.plan.record import PlannedExciter, PlannedSensor, PlannedSet, PlanResults
    from femtune.steps.report_source import ReportSource, Subject


def _plan(source: ReportSource) -> PlanResults:
    assert source.results.plan is not None
    return source.results.plan


def counts(plan: PlanResults) -> str:
    """ "10 triaxial, 15 uniaxial and 6 visualisation"."""
    kinds = [s.kind for s in plan.sensors]
    return listed(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))


def plan_numbers(plan: PlanResults) -> KeyNumbers:
    """Counts, AutoMAC and condition number, compared with those of all candidates."""
    chosen, most = plan.chosen, plan.all_candidates
    beside = f"all candidates: {unit_fraction(most.auto_mac)}"
    return KeyNumbers(
        (
            KeyNumber("Target modes", str(len(plan.modes)), remark=_band(plan)),
            KeyNumber("Sensors", str(len(plan.sensors)), remark=counts(plan)),
            KeyNumber("Measured directions", str(chosen.channels)),
            KeyNumber("Largest AutoMAC of two target modes", unit_fraction(chosen.auto_mac), remark=beside),
            KeyNumber("Condition number", _condition(chosen), remark=f"all candidates: {_condition(most)}"),
        )
    )


def _condition(planned: PlannedSet) -> str:
    return "infinite" if planned.condition is None else short(planned.condition)


def _band(plan: PlanResults) -> str:
    return f"{freq(plan.modes[0].freq_hz)} to {freq(plan.modes[-1].freq_hz)} Hz"


def plan_summary(source: ReportSource) -> list[Block]:
    """Numbers, and what should be known."""
    plan = _plan(source)
    return [plan_numbers(plan), *alert_boxes(plan.alerts), *basis(source)]


def plan_sensors(source: ReportSource) -> list[Block]:
    """The picture and the table."""
    plan = _plan(source)
    unit = source.results.study.units.partition("-")[0]
    return [*_picture(source, plan), sensor_table(plan, unit), *own_axes(plan), *exciter_tables(plan, unit)]


def _picture(source: ReportSource, plan: PlanResults) -> list[Block]:
    kept = source.results.mode_shapes[0]
    frame = structure_of(source, kept)
    if frame is None:
        return [Paragraph(f"Not drawn: {kept.reason}.")]
    both: list[PlannedSensor | PlannedExciter] = [*plan.sensors, *plan.exciters]
    nodes = [s.node for s in both]
    lines = [(nodes.index(a), nodes.index(b)) for a, b in plan.lines]
    marks = Marks(
        np.array([s.position for s in both]),
        [s.name for s in both],
        [*(s.kind for s in plan.sensors), *["exciter"] * len(plan.exciters)],
        np.array([s.axes[2] if s.direction in (None, s.axes[2]) else (0.0, 0.0, 0.0) for s in both]),
    )
    alt = f"The structure with {counts(plan)} sensors, seen from above and from below"
    notes: list[Block] = [Paragraph(f"{kept.simplified[:1].upper()}{kept.simplified[1:]}.", "muted")]
    return [Figure(partial(sensors_svg, frame, marks, lines), "", alt, wide=True), *notes * bool(kept.simplified)]


def sensor_table(plan: PlanResults, unit: str) -> Table:
    """All sensors."""
    place = f">Position{f', {unit}' if unit else ''}"
    heads = columns("Sensor", "Kind", "Point", place, ">Direction", ">Independence")
    return Table("", heads, tuple(_row(s) for s in plan.sensors))


def own_axes(plan: PlanResults) -> list[Block]:
    """Whose axes the letters behind a point are, where these are not those of the basic system."""
    axes = [*(s.axes for s in plan.sensors), *(e.axes for e in plan.exciters)]
    if not any(np.abs(np.asarray(a) - np.eye(3)).max() > _AXIS_TOLERANCE for a in axes):
        return []
    return [
        Paragraph(
            "Point: the letter is an axis of the sensor, whose axes are in the Universal File; on a surface Z is the "
            "normal. A DOF of the model, as for femtune respond, has the axes of its grid point: see Direction.",
            "muted",
        )
    ]


_AXIS_TOLERANCE = 1e-6
"""Difference of the axes of a sensor from those of the basic system that is more than rounding."""

_DIRECTIONS = " X, Y, Z"
"""Of a triaxial sensor, behind the number of its point."""


def _row(s: PlannedSensor) -> tuple[Cell, ...]:
    kind = f"{s.kind}, given" if s.given else s.kind
    place = ", ".join(short(_clean(v)) for v in s.position)
    along = NONE if s.direction is None else ", ".join(short(_clean(round(v, 4))) for v in s.direction)
    return row(
        s.name,
        kind,
        f"{s.node}{_DIRECTIONS if s.direction is None else s.dofs[0].removeprefix(str(s.node))}",
        place,
        along,
        unit_fraction(s.independence),
    )


def _clean(number: float) -> float:
    """Rounding is zero, and zero has no sign."""
    return number if abs(number) > 1e-12 else 0.0


def exciter_tables(plan: PlanResults, unit: str) -> list[Block]:
    """Exciters, and how they excite the target modes."""
    if not plan.exciters:
        return []
    place = f">Position{f', {unit}' if unit else ''}"
    heads = columns("Exciter", "Point", place, ">Direction", "Sensor at the driving point")
    rows = (
        row(
            f"{e.name}, given" if e.given else e.name,
            f"{e.node}{e.dof.removeprefix(str(e.node))}",
            ", ".join(short(_clean(v)) for v in e.position),
            ", ".join(short(_clean(round(v, 4))) for v in e.direction),
            e.sensor or "none",
        )
        for e in plan.exciters
    )
    note = (
        "Level: driving-point residue relative to that at the best candidate. Mode indicator: near 0 if the forces "
        "excite the mode as a normal mode."
    )
    modes = (row(str(m.number), m.exciter, unit_fraction(m.level), unit_fraction(m.indicator)) for m in plan.excitation)
    of_modes = columns(">Mode", "Best exciter", ">Level", ">Mode indicator")
    return [Table("", heads, tuple(rows)), Table("Excitation of the target modes", of_modes, tuple(modes), note)]


def plan_parameters(source: ReportSource) -> list[Block]:
    """Expected standard deviations of the parameters."""
    return parameter_blocks(_plan(source)) or [Paragraph("The study has no free parameters.", "muted")]


def parameter_blocks(plan: PlanResults) -> list[Block]:
    """A table with what was assumed; nothing without parameters."""
    if not plan.parameters:
        return []
    first, several = plan.parameters[0], plan.points > 1
    known, frequencies = first.candidates_sd is not None, first.frequencies_sd is not None
    titles = ["Parameter", "Unit", ">Initial value", ">σ prior", ">σ expected"]
    titles += [">σ worst in the bounds"] * several + [">σ data alone"] + [">σ frequencies alone"] * frequencies
    heads = columns(*titles, *[">σ all candidates"] * known)
    rows = []
    for p in plan.parameters:
        worst, every = [short(p.worst_sd)] * several, [short(p.candidates_sd)] * known
        undetermined = "undetermined" if p.data_sd is None else short(p.data_sd)
        alone = [short(p.frequencies_sd)] * frequencies
        sds = (short(p.prior_sd), short(p.expected_sd), *worst, undetermined, *alone, *every)
        rows.append(row(p.name, p.unit, value(p.nominal), *sds))
    return [Table("", heads, tuple(rows), _assumed(plan)), *_chosen_lines(plan)]


def _assumed(plan: PlanResults) -> str:
    of = plan.functions
    if of is None:
        return (
            "Standard deviations that an update with the target modes at these sensors would have, to first order. "
            f"Assumed are standard deviations of {short(100.0 * (plan.frequency_sd or 0.0))} % of each frequency, and "
            f"of each shape entry of {short(100.0 * (plan.shape_sd or 0.0))} % of the largest entry of the mode at all "
            "candidates."
        )
    parts = [f"{short(100.0 * of.relative_sd)} % of each value"] * bool(of.relative_sd)
    parts += [f"{short(100.0 * of.floor)} % of the largest value of each function"] * bool(of.floor)
    model = "" if of.order is None else f" They are computed with a reduced model of order {of.order}."
    return (
        "Standard deviations that an update with the FRFs between these sensors and exciters would have, to first "
        f"order: {FRF_FORMS[of.form].label} at {counted(of.lines, 'line')}. Assumed are standard deviations of real "
        f"and imaginary part of {' and '.join(parts)}.{model}"
    )


def _chosen_lines(plan: PlanResults) -> list[Block]:
    of = plan.functions
    if of is None or of.lines_key is None or plan.frequency_lines is None:
        return []
    most = plan.frequency_lines.calibration_lines
    return [
        Paragraph(
            f"The {of.lines} of {most} calibration lines that determine the parameters best are in the array "
            f"{of.lines_key}."
        )
    ]


def plan_setup(source: ReportSource) -> list[Block]:
    """Frequency lines, masses of the sensors, suspension."""
    return setup_blocks(_plan(source), source.results.study.units)


def setup_blocks(plan: PlanResults, units: str) -> list[Block]:
    """Frequency lines in sentences; tables of shifts."""
    return [*_lines(plan), *_pole_lines(plan), *_loading(plan, units), *_suspension(plan)]


def _pole_lines(plan: PlanResults) -> list[Block]:
    of = plan.pole_lines
    if of is None:
        return []
    heads = columns("Spacing", ">Root mean square %", ">Largest %", "Array")
    rows = [
        row(one.spacing, NONE if one.rms_percent is None else short(one.rms_percent),
            NONE if one.largest_percent is None else short(one.largest_percent), one.lines_key)
        for one in of.spacings
    ]  # fmt: skip
    note = (
        "Standard deviation of the poles of the target modes relative to their half bandwidth 2ζω, caused by noise of "
        f"{short(100.0 * of.relative_sd)} % of each value and {short(100.0 * of.floor)} % of the largest one of its "
        "FRF. —: some pole is not determined."
    )
    return [Table(f"{counted(of.lines, 'line')} for an identification", heads, tuple(rows), note)]


def _lines(plan: PlanResults) -> list[Block]:
    lines = plan.frequency_lines
    if lines is None:
        return []
    band = f"{freq(lines.low_hz)} to {freq(lines.high_hz)} Hz"
    per = f"at least {counted(lines.per_half_band, 'line')} per half bandwidth 2ξf at ξ = {short(lines.damping_ratio)}"
    return [
        Listing(
            (
                f"Calibration: {counted(lines.calibration_lines, 'line')}, logarithmically spaced, {band}, {per}.",
                f"Identification: resolution {short(lines.spacing_hz)} Hz, a record of {short(lines.duration_s)} s or "
                f"more per average, {counted(lines.identification_lines, 'line')} from {band}.",
                f"The lowest target mode decays to a thousandth in {short(lines.decay_s)} s.",
            )
        )
    ]


def _loading(plan: PlanResults, units: str) -> list[Block]:
    if not plan.loading:
        return []
    unit = units.split("-")[1] if units else ""
    heads = columns(">Mode", ">Shift of the frequency, %", ">by the Rayleigh quotient, %")
    rows = (
        row(str(m.number), signed_percent(m.shift_percent), signed_percent(m.rayleigh_percent)) for m in plan.loading
    )
    total = with_unit(short(plan.sensor_mass), unit)
    return [Table(f"Masses of the sensors, {total} in total", heads, tuple(rows))]


def _suspension(plan: PlanResults) -> list[Block]:
    suspension = plan.suspension
    if suspension is None:
        return []
    hung = ", ".join(short(f) for f in suspension.rigid_hz)
    heads = columns(">Mode", ">Shift of the frequency, %")
    rows = (
        row(str(m.number), signed_percent(s)) for m, s in zip(plan.modes, suspension.shift_percent) if not m.rigid_body
    )
    words = f"Suspension: {hung} Hz; first elastic mode {freq(suspension.first_elastic_hz)} Hz."
    return [Paragraph(words), Table("Effect of the suspension", heads, tuple(rows))]


def plan_modes(source: ReportSource) -> list[Block]:
    """A table of the target modes, and their AutoMAC."""
    plan = _plan(source)
    mac = source.array(plan.auto_mac_key)
    assert mac is not None
    numbers = tuple(str(m.number) for m in plan.modes)
    picture = MatrixPicture(mac, numbers, numbers, "mode", "mode")
    figure = Figure(
        partial(matrix_svg, picture),
        "AutoMAC at the sensors",
        "AutoMAC of the target modes",
        len(numbers) > SIDE_BY_SIDE,
    )
    return [mode_table(plan), figure]


def mode_table(plan: PlanResults) -> Table:
    """Frequencies, and the mode that each is most like at the sensors."""
    heads = columns(">Mode", ">Hz", ">Largest AutoMAC", ">with mode", ">at all candidates")
    rows = (
        row(
            str(m.number),
            "rigid body" if m.rigid_body else freq(m.freq_hz),
            unit_fraction(m.auto_mac),
            NONE if m.alike_number is None else str(m.alike_number),
            unit_fraction(m.auto_mac_candidates),
        )
        for m in plan.modes
    )
    return Table("", heads, tuple(rows))


def plan_method(source: ReportSource) -> list[Block]:
    """How the candidates were found, and how the sensors were placed."""
    plan = _plan(source)
    cited = tuple(c.text for c in source.results.citations)
    sources: list[Block] = [Heading("Publications"), Listing(cited)] if cited else []
    return [Listing(tuple(method_sentences(plan))), *sources]


def method_sentences(plan: PlanResults) -> list[str]:
    """The method in sentences."""
    placed = PLACEMENT_METHODS[plan.method].text
    if plan.criterion is not None:
        what = CRITERIA[plan.criterion].text
        where = "at the initial values" if plan.points == 1 else f"at {plan.points} points within the bounds"
        of = "" if plan.functions is None else " from the FRFs"
        placed = f"sensors were placed one by one for the {what} the parameters{of}, {where}"
    sentences = [
        f"Candidates: {counted(plan.candidate_points, 'grid point')} that move in at least one target mode, with "
        f"{counted(plan.candidate_directions, 'uniaxial direction')}.",
        f"Method {plan.method}: {placed}. {WEIGHTINGS[plan.weighting].text}",
        f"Thresholds of the output Gramian: {short(plan.triaxial_threshold)} for triaxial and "
        f"{short(plan.uniaxial_threshold)} for uniaxial sensors; {counted(plan.rejected, 'candidate')} rejected.",
    ]
    if plan.exchanges:
        sentences.append(f"After the placement {counted(plan.exchanges, 'sensor')} exchanged for better ones.")
    if plan.rigid_left_out:
        sentences.append(f"{counted(plan.rigid_left_out, 'rigid-body mode')} left out of the target modes.")
    return sentences


def plan_verdict(plan: PlanResults) -> tuple[str, Level]:
    """Whether the sensors distinguish the target modes, in one sentence."""
    level: Level = "warning" if any(a.level != "info" for a in plan.alerts) else "info"
    modes, channels = counted(len(plan.modes), "target mode"), counted(plan.chosen.channels, "measured direction")
    return f"{channels} for {modes}; the largest AutoMAC is {unit_fraction(plan.chosen.auto_mac)}.", level


def plan_document(subject: Subject, plan: PlanResults) -> Document:
    """Numbers, sensors, target modes and method."""
    verdict, level = plan_verdict(plan)
    alerts = tuple(AlertBox(a.level, a.code, a.sentence, a.where) for a in plan.alerts)
    sections = (
        Section("plan", f"Test plan: {plan.configuration}", (plan_numbers(plan), *alerts)),
        Section(
            "sensors",
            "Sensors",
            (sensor_table(plan, subject.length_unit), *own_axes(plan), *exciter_tables(plan, subject.length_unit)),
        ),
        Section("modes", "Target modes", (mode_table(plan),)),
        Section("parameters", "Expected standard deviations of the parameters", tuple(parameter_blocks(plan))),
        Section("setup", "Frequency lines, masses, suspension", tuple(setup_blocks(plan, _units(subject)))),
        Section("method", "Method", (Listing(tuple(method_sentences(plan))),)),
    )
    return subject.document(verdict, level, sections)


def _units(subject: Subject) -> str:
    return f"{subject.length_unit}-{subject.mass_unit}-s" if subject.mass_unit else ""
