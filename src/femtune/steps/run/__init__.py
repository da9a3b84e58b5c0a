"""The whole run of a study."""

from __future__ import annotations

from pathlib import Path

from femtune.steps.step import (
    EIGENSOLVER,
    FRESH,
    JOBS,
    JSON,
    OUTPUT,
    STUDY,
    WIDE,
    Command,
    ReportSection,
    Step,
    end_of_run,
)

STEP = Step(
    "run",
    command=Command(
        help=(
            "Correlate, select, update, validate and report: the run folder receives results, updated "
            "deck and report.\n\n"
            "An interrupted run continues from the solutions in its journal."
        ),
        params=(
            STUDY,
            OUTPUT,
            WIDE,
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        data=lambda result: result.results,
        whole_run=True,
        last=lambda result: f"report: {Path(result.report).resolve()}",
        ends=end_of_run,
    ),
    sections=(
        ReportSection("summary", "Summary", "run.page.review:review", place=10),
        ReportSection("method", "Method and citations", "run.page.method:method", place=200),
        ReportSection("provenance", "Provenance", "run.page.method:provenance", place=210),
    ),
)
