"""Mean and covariance of the parameters from repeated tests."""

from __future__ import annotations

from femtune.steps.step import EIGENSOLVER, FRESH, JOBS, JSON, STUDY, Command, InRun, ReportSection, Step

STEP = Step(
    "quantify",
    tables=("quantify",),
    in_run=(InRun("quantify", "quantify.in_run:quantify_after", 150, optional="variability of the parameters"),),
    command=Command(
        group="Uncertainty",
        help="Estimate mean and covariance of the parameters from repeated tests.",
        params=(
            STUDY,
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        document="quantify.page:quantify_document",
    ),
    sections=(
        ReportSection(
            "quantify",
            "Variability over repeated tests",
            "quantify.page:quantify",
            intro=(
                "Nominally identical structures, or one structure that was reassembled, give different test "
                "results. This section states the variability of the parameters that explains these "
                "differences."
            ),
            optional=True,
            place=130,
        ),
    ),
)
