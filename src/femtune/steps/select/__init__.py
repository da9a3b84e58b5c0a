"""Which parameters the data determine."""

from __future__ import annotations

from femtune.steps.step import EIGENSOLVER, FRESH, JSON, STUDY, Command, InRun, ReportSection, Step

STEP = Step(
    "select",
    tables=("select",),
    in_run=(InRun("select", "select.in_run:select_before", 50),),
    command=Command(
        group="Model and test",
        help="Which parameters and combinations of parameters the data determine.",
        params=(
            STUDY,
            EIGENSOLVER,
            FRESH,
            JSON,
        ),
        document="select.page:selection_document",
    ),
    sections=(
        ReportSection(
            "identifiability",
            "What the data determine",
            "select.page:identifiability",
            intro=(
                "This section states which parameters, and which combinations of parameters, the measurements "
                "determine."
            ),
            optional=True,
            place=110,
        ),
    ),
)
