"""Sections of the report: configurations, sensors, test modes left out."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Figure, Heading, Listing, Paragraph, Table, columns, row, table_or_none
from femtune.document.figures.sensors import TestPoint, test_points_svg
from femtune.document.numbers import NONE, counted, listed, percent, short
from femtune.steps.modes.page.mode_shapes import structure_of

if TYPE_CHECKING:
    from femtune.document.document import Block, Cell
    from femtune.steps.correlate.record.correlation import CorrelationResults
    from femtune.steps.info.record.model import MatchedSensor, SensorResults
    from femtune.steps.report_source import ReportSource

_MOST_UNFOLDED_ROWS = 24
"""Rows of the largest sensor table that is shown unfolded: about half a screen."""

_TOLD_ELSEWHERE = ("update.", "write.")
"""Areas whose notes stand in the sections about the update and the deck."""


def compared(source: ReportSource) -> list[Block]:
    """What took part in the comparison and what did not."""
    return [
        _configurations(source),
        _left_out(source),
        *_notes(source),
        Heading("Sensors"),
        *(_unmatched(names, s) for names, s in _alike(source)),
        *(block for names, s in _alike(source) for block in _drawn(source, names, s)),
        *(_matched(names, s, source.results.study.units) for names, s in _alike(source)),
        *([] if source.results.sensors else [Paragraph("The sensors were not matched.")]),
        *(
            block
            for c in source.results.correlations
            if c.stage == "before"
            for block in placement_blocks(c, source.results.study.units)
        ),
    ]


def placement_blocks(comparison: CorrelationResults, units: str = "") -> list[Block]:
    """Standard deviations from errors in the placement of the sensors, for page and terminal; [] without any."""
    record = comparison.placement
    if record is None or not record.modes:
        return []
    heads = columns("Test mode", ">± % of the largest entry", ">Largest ± %", "Sensor", ">1 − MAC")
    rows = tuple(
        row(m.test_label, percent(m.sd_percent), percent(m.largest_percent), m.largest_dof, short(m.mac_loss))
        for m in record.modes
    )
    length = units.split("-", maxsplit=1)[0] if units else ""
    note = (
        f"Standard deviations of the shapes from errors of the positions ({_span(record.position_sd)} {length}) and "
        f"the directions ({_span(record.angle_sd_deg)}°) of the sensors, and the mean loss of MAC that they alone "
        "cause. Residuals of shape differences include them in their covariance."
    )
    title = f"{comparison.configuration}: effect of the placement of the sensors"
    return [Table(title, heads, rows, note.replace(" )", ")"))]


def _span(ends: tuple[float, float]) -> str:
    low, high = map(short, ends)
    return low if low == high else f"{low} to {high}"


def _configurations(source: ReportSource) -> Block:
    heads = columns(
        "Configuration", "Test file", ">Sensors matched", ">Not matched", ">Pairs", ">Left out", "Changes to the deck"
    )
    return Table("Configurations", heads, tuple(_configuration(source, c) for c in source.results.study.configurations))


def _configuration(source: ReportSource, name: str) -> tuple:
    sensors = next((s for s in source.results.sensors if s.configuration == name), None)
    model = source.results.model
    overlay = next((c.overlay for c in (model.configurations if model else ()) if c.configuration == name), ())
    compared = source.before(name)
    return row(
        name,
        sensors.test_file if sensors else NONE,
        str(len(sensors.matched)) if sensors else NONE,
        str(len(sensors.unmatched)) if sensors else NONE,
        _pairs(source, name),
        str(len(compared.left_out)) if compared else NONE,
        "; ".join(overlay) or "none",
    )


def _pairs(source: ReportSource, name: str) -> str:
    return " → ".join(str(len(comparison.pairs)) for comparison in source.shown(name)) or _without_modes(source, name)


def _without_modes(source: ReportSource, name: str) -> str:
    """What else was compared in a configuration of which no modes were."""
    update = source.results.update
    kinds = dict.fromkeys(c.kind for c in (update.comparisons if update else ()) if c.configuration == name)
    return f"no modes; {listed(kinds)}" if kinds else "not compared"


def _notes(source: ReportSource) -> list[Block]:
    """What is good to know about the data but asks for nothing."""
    notes = [a for a in source.results.alerts if a.level == "info" and not a.code.startswith(_TOLD_ELSEWHERE)]
    lines = tuple(f"{a.sentence} [{a.code}{f', {a.where}' if a.where else ''}]" for a in notes)
    return [Heading("Notes on the test files and sensors"), Listing(lines)] if lines else []


def _left_out(source: ReportSource) -> Block:
    rows = [row(", ".join(m.configurations), ", ".join(m.labels), m.reason) for m in source.left_out()]
    heads = columns("Configurations", "Test modes", "Reason")
    return table_or_none("Modes left out by the study", heads, rows, "No test mode was excluded.")


def _alike(source: ReportSource) -> list[tuple[str, SensorResults]]:
    """Configurations whose sensors are matched in the same way share a table: their names, and one of them."""
    groups: dict[tuple, list[SensorResults]] = {}
    for sensors in source.results.sensors:
        groups.setdefault((sensors.tolerance, sensors.matched, sensors.unmatched), []).append(sensors)
    return [(", ".join(s.configuration for s in group), group[0]) for group in groups.values()]


def _drawn(source: ReportSource, names: str, sensors: SensorResults) -> list[Block]:
    """The test points on the structure, each with its grid point; [] without places or mesh."""
    known = {s.test_node: s for s in sensors.matched if s.place is not None and s.grid_place is not None}
    points = [TestPoint(n, s.place, s.grid_place) for n, s in known.items() if s.place is not None]
    kept = next((m for m in source.results.mode_shapes if m.configuration == sensors.configuration), None)
    frame = structure_of(source, kept) if points and kept is not None and not kept.reason else None
    if frame is None:
        return []
    alt = f"{names}: the structure with {counted(len(points), 'test point')}, seen from above and from below"
    caption = f"{names}: test points at their coordinates, each with a line to its grid point"
    return [Figure(partial(test_points_svg, frame, points), caption, alt, wide=True)]


def _matched(names: str, sensors: SensorResults, units: str) -> Block:
    unit = units.partition("-")[0]
    tolerance = f", tolerance {short(sensors.tolerance)} {unit}" if sensors.tolerance is not None else ""
    title = f"{names}: {counted(len(sensors.matched), 'sensor')} matched{tolerance}"
    heads = columns(">Test node", "Measured DOFs", ">Model grid", f">Distance ({unit})", "How")
    rows = tuple(_at_one_place(together) for together in _by_place(sensors))
    if not rows:
        return Paragraph(f"{names}: no sensor could be matched.")
    return Table(title, heads, rows, folded=len(rows) > _MOST_UNFOLDED_ROWS)


def _by_place(sensors: SensorResults) -> list[list[MatchedSensor]]:
    """Sensors of one test node that found the model in the same way."""
    places: dict[tuple, list[MatchedSensor]] = {}
    for s in sensors.matched:
        places.setdefault((s.test_node, s.model_node, s.distance, s.how), []).append(s)
    return list(places.values())


def _at_one_place(sensors: list[MatchedSensor]) -> tuple[Cell, ...]:
    s = sensors[0]
    node = str(s.test_node)
    dofs = ", ".join(_typeset(m.test_dof.removeprefix(node)) for m in sensors)
    return row(node, dofs, str(s.model_node) if s.model_node is not None else "several", short(s.distance), s.how)


def _typeset(direction: str) -> str:
    """ "X" for "X+", "−X" for "X-"."""
    return f"−{direction[:-1]}" if direction.endswith("-") else direction.removesuffix("+")


def _unmatched(names: str, sensors: SensorResults) -> Block:
    rows = [row(s.test_dof, s.reason) for s in sensors.unmatched]
    title = f"{names}: sensors that were not matched"
    none = f"{names}: every sensor was matched."
    return table_or_none(title, columns("Measured DOF", "Reason"), rows, none)
