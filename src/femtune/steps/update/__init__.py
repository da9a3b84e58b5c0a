"""The update of the parameters."""

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
    InRun,
    ReportSection,
    Step,
    end_of_update,
)

STEP = Step(
    "update",
    tables=("update", "reduction", "stage"),
    in_run=(
        InRun("update", "update.in_run:update", 60),
        InRun("truncation", "update.in_run:truncation", 70, optional="error of the FRFs by truncation of the modes"),
        InRun("left-out modes", "update.in_run:left_out_modes", 80),
    ),
    command=Command(
        help=(
            "Update the parameters and write the updated deck.\n\n"
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
        last=lambda result: f"results: {Path(result.folder).resolve()}",
        ends=end_of_update,
    ),
    sections=(
        ReportSection("parameters", "Parameters", "update.page.parameters:parameters", place=90),
        ReportSection("convergence", "Convergence", "update.page.convergence:convergence", optional=True, place=100),
    ),
)
