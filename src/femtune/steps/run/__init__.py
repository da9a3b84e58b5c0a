"""The whole run of a study."""

from __future__ import annotations

from pathlib import Path

from femtune.steps.step import (
    CHOICES,
    EIGENSOLVER,
    FRESH,
    JOBS,
    JSON,
    OUTPUT,
    STRICT,
    STUDY,
    WIDE,
    Command,
    InRun,
    ReportSection,
    Step,
    end_of_judged,
)

STEP = Step(
    "run",
    in_run=(
        InRun("model", "run.in_run:prepare", 10),
        InRun("checks of later steps", "run.in_run:check_later_parts", 30),
    ),
    command=Command(
        group="First steps",
        help=(
            "Correlate, select, update, validate and report: the run folder receives results, updated "
            "deck and report.\n\n"
            "An interrupted run continues from the solutions in its journal. The exit code is 4 if the verdict is: not "
            "accepted."
        ),
        params=(
            STUDY,
            CHOICES,
            OUTPUT,
            WIDE,
            EIGENSOLVER,
            FRESH,
            JOBS,
            STRICT,
            JSON,
        ),
        data=lambda result: result.results,
        whole_run=True,
        last=lambda result: f"report: {Path(result.report).resolve()}",
        ends=lambda result: end_of_judged(result.results.judgement),
    ),
    sections=(
        ReportSection("summary", "Summary", "run.page.review:review", place=10),
        ReportSection("method", "Method and citations", "run.page.method:method", place=200),
        ReportSection("provenance", "Provenance", "run.page.method:provenance", place=210),
    ),
)
