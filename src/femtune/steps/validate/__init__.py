"""Comparison with data that the update did not use."""

from __future__ import annotations

from femtune.steps.step import (
    EIGENSOLVER,
    FRESH,
    JOBS,
    JSON,
    OUTPUT,
    STRICT,
    STUDY,
    Command,
    InRun,
    ReportSection,
    Step,
    end_of_judged,
)

STEP = Step(
    "validate",
    tables=("validate", "hold_out"),
    in_run=(InRun("unused FRFs", "validate.in_run:compare_unused_frfs", 120),),
    command=Command(
        group="Model and test",
        help=(
            "Compare the updated model with data that the update did not use.\n\n"
            "The model is updated first, as by `update`; solutions of an earlier run are read from its "
            "journal. The exit code is 4 if the verdict is: not accepted."
        ),
        params=(
            STUDY,
            OUTPUT,
            EIGENSOLVER,
            FRESH,
            JOBS,
            STRICT,
            JSON,
        ),
        data=lambda result: result.results.validation,
        document="validate.page:validation_document",
        shown=lambda result: (result.results,),
        ends=lambda result: end_of_judged(result.results.judgement),
    ),
    sections=(
        ReportSection(
            "validation", "Validation, and what was not tested", "validate.page:validation", optional=True, place=160
        ),
        ReportSection(
            "criteria",
            "Acceptance criteria",
            "validate.page:criteria",
            intro=(
                "The criteria are evaluated over all paired modes of each test, including the modes that the "
                "update was fitted to. Data that the update did not use are judged by the same limits in the "
                "validation section."
            ),
            place=190,
        ),
    ),
)
