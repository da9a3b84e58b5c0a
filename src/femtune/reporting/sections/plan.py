"""A planned test: its numbers, the sensors on the structure, the target modes, and how the sensors were placed."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.reporting.document import (
    AlertBox,
    Cell,
    Figure,
    KeyNumber,
    KeyNumbers,
    Listing,
    Paragraph,
    Table,
    columns,
    row,
)
from femtune.reporting.figures.matrix import SIDE_BY_SIDE, MatrixPicture, matrix_svg
from femtune.reporting.figures.sensors import Marks, sensors_svg
from femtune.reporting.numbers import NONE, counted, freq, listed, short, unit_fraction
from femtune.reporting.sections.mode_shapes import structure_of

if TYPE_CHECKING:
    from femtune.reporting.document import Block
    from femtune.reporting.source import ReportSource
    from femtune.results.plan import PlannedSensor, PlannedSet, PlanResults


def _plan(source: ReportSource) -> PlanResults:
    assert source.results.plan is not None
    return source.results.plan


def counts(plan: PlanResults) -> str:
    """ "10 triaxial, 15 uniaxial and 6 visualisation"."""
    kinds = [s.kind for s in plan.sensors]
    return listed(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))


def plan_numbers(plan: PlanResults) -> KeyNumbers:
    """Counts, AutoMAC and condition number, beside those of all candidates."""
    chosen, most = plan.chosen, plan.all_candidates
    beside = f"all candidates: {unit_fraction(most.auto_mac)}"
    return KeyNumbers(
        (
            KeyNumber("Target modes", str(len(plan.modes)), remark=_band(plan)),
            KeyNumber("Sensors", str(len(plan.sensors)), remark=counts(plan)),
            KeyNumber("Measured directions", str(chosen.channels)),
            KeyNumber("Largest AutoMAC of two target modes", unit_fraction(chosen.auto_mac), remark=beside),
            KeyNumber("Condition number", _condition(chosen), remark=f"all candidates: {_condition(most)}"),
            KeyNumber("Candidates", str(plan.candidate_points), remark="grid points"),
        )
    )


def _condition(found: PlannedSet) -> str:
    return "infinite" if found.condition is None else short(found.condition)


def _band(plan: PlanResults) -> str:
    return f"{freq(plan.modes[0].freq_hz)} to {freq(plan.modes[-1].freq_hz)} Hz"


def plan_summary(source: ReportSource) -> list[Block]:
    """Numbers, and what should be known."""
    plan = _plan(source)
    return [plan_numbers(plan), *(AlertBox(a.level, a.code, a.sentence, a.where) for a in plan.alerts)]


def plan_sensors(source: ReportSource) -> list[Block]:
    """The picture and the table."""
    plan = _plan(source)
    return [*_picture(source, plan), sensor_table(plan, source.results.study.units.partition("-")[0])]


def _picture(source: ReportSource, plan: PlanResults) -> list[Block]:
    kept = source.results.mode_shapes[0]
    frame = structure_of(source, kept)
    if frame is None:
        return [Paragraph(f"Not drawn: {kept.reason}.")]
    nodes = [s.node for s in plan.sensors]
    lines = [(nodes.index(a), nodes.index(b)) for a, b in plan.lines]
    marks = Marks(
        np.array([s.position for s in plan.sensors]),
        [s.name for s in plan.sensors],
        [s.kind for s in plan.sensors],
        np.array([s.axes[2] if s.direction in (None, s.axes[2]) else (0.0, 0.0, 0.0) for s in plan.sensors]),
    )
    alt = f"The structure with {counts(plan)} sensors, seen from above and from below"
    notes: list[Block] = [Paragraph(f"{kept.simplified[:1].upper()}{kept.simplified[1:]}.", "muted")]
    return [Figure(partial(sensors_svg, frame, marks, lines), "", alt, wide=True), *notes * bool(kept.simplified)]


def sensor_table(plan: PlanResults, unit: str) -> Table:
    """All sensors."""
    place = f">Position{f', {unit}' if unit else ''}"
    heads = columns("Sensor", "Kind", "Point", place, ">Direction", ">Independence")
    return Table("", heads, tuple(_row(s) for s in plan.sensors))


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
    return [Listing(tuple(method_sentences(plan)))]


def method_sentences(plan: PlanResults) -> list[str]:
    """The method in sentences."""
    words = {
        "expansion": "sensors were placed one by one, where they increase the determinant of the information most",
        "elimination": "the candidate with the least effective independence was removed until all others were wanted",
    }
    weighted = {
        "none": "All candidates have equal weight.",
        "kinetic-energy": "Candidates are weighted by kinetic energy: shapes are multiplied by the square root of "
        "the mass at the grid point.",
    }
    found = [
        f"Candidates: {counted(plan.candidate_points, 'grid point')} that move in at least one target mode, with "
        f"{counted(plan.candidate_directions, 'uniaxial direction')}.",
        f"Method {plan.method}: {words[plan.method]}. {weighted[plan.weighting]}",
        f"Thresholds of the output Gramian: {short(plan.triaxial_threshold)} for triaxial and "
        f"{short(plan.uniaxial_threshold)} for uniaxial sensors; {counted(plan.rejected, 'candidate')} rejected.",
    ]
    if plan.exchanges:
        found.append(f"After the placement {counted(plan.exchanges, 'sensor')} exchanged for better ones.")
    if plan.rigid_left_out:
        found.append(f"{counted(plan.rigid_left_out, 'rigid-body mode')} left out of the target modes.")
    return found
