"""On data that the update did not use: verdicts, predictions beside their scatter, and what was not tested."""

from __future__ import annotations

from femtune.report.document import (
    Block,
    Cell,
    Column,
    Figure,
    Heading,
    Listing,
    Paragraph,
    Table,
    Tone,
    columns,
    row,
    without_column,
)
from femtune.report.figures.predictions import PredictedMode, predictions_svg
from femtune.report.numbers import (
    NONE,
    NOT_TESTED,
    counted,
    freq,
    listed,
    percent,
    short,
    signed_percent,
    value,
    with_unit,
)
from femtune.report.sections.modes import mac_cell
from femtune.report.sections.verdict_cell import verdict_cell
from femtune.report.source import Source
from femtune.study.results_validation import Prediction, ValidationResults, ValidationVerdict


def validation(source: Source) -> list[Block]:
    """Verdicts, predictions beside measurements, held-out sensors, then the list of what nobody looked at."""
    found = source.results.validation
    if found is None:
        return [Paragraph("Not tested: no validation was run, so nothing here says how well the model predicts.")]
    return [
        *validation_verdicts(found),
        *_picture(found),
        *prediction_blocks(found, [m.reason for m in source.left_out()]),
        *sensor_blocks(found),
        Heading("What was not tested"),
        _listing([*untested_reasons(found), *found.not_tested]),
    ]


def _listing(lines: list[str]) -> Block:
    return Listing(tuple(lines)) if lines else Paragraph("Nothing is listed.")


def outcome_sentence(found: ValidationResults) -> str:
    """How many criteria passed on data that were not used, without a full stop; "" where none was tested."""
    tested = [v for v in found.verdicts if v.verdict != NOT_TESTED]
    failed = [v for v in tested if v.verdict == "fail"]
    if not tested:
        return ""
    count = f"{len(tested) - len(failed)} of {counted(len(tested), 'criterion', 'criteria')}"
    where = listed(dict.fromkeys(v.configuration for v in failed))
    tail = f"; {len(failed)} failed in {where}" if failed else ""
    return f"on data that the update did not use {count} passed ({found.profile}){tail}"


def validation_verdicts(found: ValidationResults) -> list[Block]:
    """The outcome in a sentence, and a table of the criteria that were tested."""
    sentence = outcome_sentence(found)
    if not sentence:
        return []
    heads = columns("Configuration", "Data", "Criterion", ">Required", ">Measured", "Verdict", "Decided by")
    rows = tuple(_verdict_row(v) for v in found.verdicts if v.verdict != NOT_TESTED)
    noise = tuple(f"{v.configuration}, {v.criterion}: {v.noise}" for v in found.verdicts if v.noise)
    misses: list[Block] = [Heading("What noise explains of the misses"), Listing(noise)] if noise else []
    tone: Tone = "poor" if any(v.verdict == "fail" for v in found.verdicts) else "good"
    return [Paragraph(f"{sentence[0].upper()}{sentence[1:]}.", tone), Table("", heads, rows), *misses]


def _verdict_row(v: ValidationVerdict) -> tuple[Cell, ...]:
    asked = with_unit(f"{'≤' if v.sense == 'at most' else '≥'} {value(v.required)}", v.unit)
    measured = NOT_TESTED if v.measured is None else with_unit(short(v.measured), v.unit)
    return row(v.configuration, v.data, v.criterion, asked, measured, verdict_cell(v.verdict), v.remark or NONE)


def untested_reasons(found: ValidationResults) -> list[str]:
    """Criteria that were not tested, those with one reason together."""
    reasons: dict[tuple[str, str], dict[str, None]] = {}
    for v in found.verdicts:
        if v.verdict == NOT_TESTED:
            reasons.setdefault((v.configuration, v.remark), {})[v.criterion] = None
    return [f"{name}: {'; '.join(criteria)}: {reason}" for (name, reason), criteria in reasons.items()]


def _picture(found: ValidationResults) -> list[Block]:
    modes = [_predicted(p) for p in found.predictions if p.data and p.freq_error_percent is not None]
    if not modes:
        return []
    limits = [v.required for v in found.verdicts if v.criterion.startswith("frequency error")]
    limit = min(limits, default=None)
    caption = (
        "Errors of predicted frequencies (model − test)/test: grey ring before the update, blue dot after it; the "
        "bar is ± 2 σ of what the scatter of test and parameters gives around zero"
        + (f", the orange lines are the strictest limit asked for ({value(limit)} %)." if limit else ".")
    )
    alt = f"Errors of {counted(len(modes), 'predicted frequency', 'predicted frequencies')} beside their scatter"
    return [Figure(lambda: predictions_svg(modes, limit), caption, alt)]


def _predicted(p: Prediction) -> PredictedMode:
    known = p.test_sd_percent is not None
    sd = ((p.test_sd_percent or 0.0) ** 2 + (p.parameter_sd_percent or 0.0) ** 2) ** 0.5 if known else None
    label = f"{p.configuration}, mode {p.test_label}"
    return PredictedMode(label, p.before_freq_error_percent, p.freq_error_percent or 0.0, sd)


def prediction_blocks(found: ValidationResults, known_reasons: list[str]) -> list[Block]:
    """All measured modes that the update did not use: a table each configuration and kind of data."""
    if not found.predictions:
        return [Paragraph("No measured mode was held out: how well the model predicts was not tested.")]
    groups: dict[str, list[Prediction]] = {}
    for p in found.predictions:
        groups.setdefault(f"{p.configuration}: {p.data or 'left out'}", []).append(p)
    tables = [_predictions(title, rows, known_reasons) for title, rows in groups.items()]
    note = "z is the error in units of the σ of test and parameters together; beyond 2 scatter is not the reason."
    known = any(p.z is not None for p in found.predictions)
    return [Heading("Measured modes that the update did not use"), *tables, *([Paragraph(note, "muted")] * known)]


def _predictions(title: str, rows: list[Prediction], known_reasons: list[str]) -> Table:
    heads = (
        *columns("Mode", ">Test Hz", ">Model no.", ">Hz"),
        *(Column(head, "right", "Error %") for head in ("before", "after")),
        *(Column(head, "right", "σ %") for head in ("test", "parameters")),
        *columns(">z", ">MAC", "Remark"),
    )
    table = Table(title, heads, tuple(_row(p, known_reasons) for p in rows))
    return table if any(_remark(p, known_reasons) for p in rows) else without_column(table, "Remark")


def _row(p: Prediction, known_reasons: list[str]) -> tuple[Cell, ...]:
    return row(
        p.test_label,
        freq(p.test_freq_hz),
        str(p.model_number) if p.model_number is not None else "none answers",
        freq(p.model_freq_hz),
        signed_percent(p.before_freq_error_percent),
        signed_percent(p.freq_error_percent),
        percent(p.test_sd_percent),
        percent(p.parameter_sd_percent),
        NONE if p.z is None else signed_percent(p.z),
        mac_cell(p.mac),
        Cell(_remark(p, known_reasons), tone="muted"),
    )


def _remark(p: Prediction, known_reasons: list[str]) -> str:
    """The study's reason for leaving a mode out stands in the table of modes left out."""
    if p.data:
        return "" if p.paired else "no pair, only the most alike"
    return "left out by the study" if p.remark in known_reasons else p.remark


def sensor_blocks(found: ValidationResults) -> list[Block]:
    """Shapes at the sensors that were held out."""
    if not found.held_out_sensors:
        return []
    heads = columns("Configuration", "Shape of", ">Error %", ">Noise gives %")
    rows = tuple(
        row(s.configuration, s.test_label, short(s.error_percent), short(s.noise_percent)) for s in found.shapes
    )
    names = ", ".join(found.held_out_sensors[:8])
    more = len(found.held_out_sensors) - 8
    note = f"Held out: {names}{f' and {more} more' if more > 0 else ''}. "
    note += "The error is test − model, root mean square, over that of the shape; the scale is of the sensors used."
    return [Table("Shapes at held-out sensors", heads, rows, note)]
