"""Modes that were not used, and what was not tested."""

from __future__ import annotations

from femtune.report.document import Block, Cell, Heading, Listing, Paragraph, columns, row, table_or_none
from femtune.report.numbers import NONE, freq, signed_percent
from femtune.report.sections.modes import mac_cell
from femtune.report.source import Source
from femtune.study.results_correlation import Prediction


def validation(source: Source) -> list[Block]:
    """Predictions beside measurements, then the list of what nobody looked at."""
    found = source.results.validation
    if found is None:
        return [Paragraph("Not tested: no validation was run, so nothing here says how well the model predicts.")]
    heads = columns(
        "Configuration", "Test mode", ">Hz", ">Model mode", ">Hz", ">Error before %", ">Error %", ">MAC", "Remark"
    )
    none = "No measured mode was held out: how well the model predicts was not tested."
    return [
        table_or_none(
            "Measured modes that the update did not use", heads, [_row(source, p) for p in found.predictions], none
        ),
        Heading("What was not tested"),
        Listing(found.not_tested) if found.not_tested else Paragraph("Nothing is listed."),
    ]


def _row(source: Source, p: Prediction) -> tuple[Cell, ...]:
    return row(
        p.configuration,
        p.test_label,
        freq(p.test_freq_hz),
        str(p.model_number) if p.model_number is not None else "none answers",
        freq(p.model_freq_hz),
        signed_percent(p.before_freq_error_percent),
        signed_percent(p.freq_error_percent),
        mac_cell(p.mac),
        _remark(source, p),
    )


def _remark(source: Source, p: Prediction) -> str:
    """The study's reason for leaving a mode out stands in the table of modes left out."""
    known = any(p.remark == m.reason and p.test_label in m.labels for m in source.left_out())
    return "left out by the study" if known else p.remark or NONE
