"""Configurations, sensors, modes left out."""

from __future__ import annotations

from femtune.report.document import Block, Heading, Paragraph, Table, columns, row, table_or_none
from femtune.report.numbers import NONE, counted, short
from femtune.report.source import Source
from femtune.study.results_model import SensorResults


def compared(source: Source) -> list[Block]:
    """What took part in the comparison and what did not."""
    return [
        _configurations(source),
        _left_out(source),
        Heading("Sensors"),
        *(_unmatched(names, s) for names, s in _alike(source)),
        *(_matched(names, s, source.results.study.units) for names, s in _alike(source)),
        *([] if source.results.sensors else [Paragraph("Sensors were not matched: not run.")]),
    ]


def _configurations(source: Source) -> Block:
    heads = columns("Configuration", "Test file", ">Sensors matched", ">unmatched", ">Pairs", ">Left out", "Overlay")
    return Table("Configurations", heads, tuple(_configuration(source, c) for c in source.results.study.configurations))


def _configuration(source: Source, name: str) -> tuple:
    sensors = next((s for s in source.results.sensors if s.configuration == name), None)
    model = source.results.model
    overlay = next((c.overlay for c in (model.configurations if model else ()) if c.configuration == name), ())
    compared = source.before(name)
    return row(
        name,
        sensors.test_file if sensors else NONE,
        str(len(sensors.matched)) if sensors else NONE,
        str(len(sensors.unmatched)) if sensors else NONE,
        str(len(compared.pairs)) if compared else "not compared",
        str(len(compared.left_out)) if compared else NONE,
        "; ".join(overlay) or "none: the deck as it is",
    )


def _left_out(source: Source) -> Block:
    rows = [row(", ".join(m.configurations), ", ".join(m.labels), m.reason) for m in source.left_out()]
    heads = columns("Configurations", "Test modes", "Reason")
    return table_or_none("Modes left out by the study", heads, rows, "The study leaves no mode out.")


def _alike(source: Source) -> list[tuple[str, SensorResults]]:
    """Configurations whose sensors are matched alike share a table: their names, and one of them."""
    groups: dict[tuple, list[SensorResults]] = {}
    for sensors in source.results.sensors:
        groups.setdefault((sensors.tolerance, sensors.matched, sensors.unmatched), []).append(sensors)
    return [(", ".join(s.configuration for s in group), group[0]) for group in groups.values()]


def _matched(names: str, sensors: SensorResults, units: str) -> Block:
    tolerance = f", tolerance {short(sensors.tolerance)}" if sensors.tolerance is not None else ""
    title = f"{names}: {counted(len(sensors.matched), 'sensor')} matched{tolerance}"
    heads = columns("Measured DOF", ">Test node", ">Model grid", f">Distance ({units.partition('-')[0]})", "How")
    rows = [
        row(
            s.test_dof,
            str(s.test_node),
            str(s.model_node) if s.model_node is not None else "several",
            short(s.distance),
            s.how,
        )
        for s in sensors.matched
    ]
    return table_or_none(title, heads, rows, f"{names}: no sensor could be matched.")


def _unmatched(names: str, sensors: SensorResults) -> Block:
    rows = [row(s.test_dof, s.reason) for s in sensors.unmatched]
    title = f"{names}: sensors left aside"
    none = f"{names}: every sensor was matched."
    return table_or_none(title, columns("Measured DOF", "Reason"), rows, none)
