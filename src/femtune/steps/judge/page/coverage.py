"""Where the end of an update lies in the runs of its model."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.document import Heading, Paragraph, Table, columns, row
from femtune.document.numbers import short

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.report_source import ReportSource


def coverage_blocks(source: ReportSource) -> Iterable[Block]:
    """Nothing for models that are not made of a table of runs."""
    judged = source.results.judgement
    coverage = judged.coverage if judged else None
    if coverage is None:
        return
    yield Heading("Range of the runs")
    if coverage.outside:
        heads = columns("Parameter", ">Updated", ">Least value in the runs", ">Largest value in the runs")
        rows = (row(o.parameter, f"{o.value:.5g}", f"{o.low:.5g}", f"{o.high:.5g}") for o in coverage.outside)
        yield Table("Values outside the runs", heads, tuple(rows))
    else:
        yield Paragraph("All parameters ended within the values of the runs.")
    if coverage.frequency_sd_percent is not None:
        yield Paragraph(
            "Standard deviation that the surrogate states for a frequency at the end: "
            f"{short(coverage.frequency_sd_percent)} % at most (mode {coverage.mode}; "
            f"limit {short(coverage.limit_percent)} %)."
        )
