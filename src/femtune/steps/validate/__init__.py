"""Comparison with data that the update did not use."""

from __future__ import annotations

from typing import Any

from femtune.steps.step import EIGENSOLVER, FRESH, JOBS, JSON, OUTPUT, STUDY, Command, End, Section, Step, end_of_run


def _end(result: Any) -> End:
    end = end_of_run(result)
    failed = any(v.verdict == "fail" for v in result.results.validation.verdicts)
    return End(end.told, 1) if failed else end


STEP = Step(
    "validate",
    command=Command(
        help=(
            "Compare the updated model with data that the update did not use.\n\n"
            "The model is updated first, as by `update`; solutions of an earlier run are read from its "
            "journal. The exit code is 1 if a criterion fails or the update did not reach an optimum."
        ),
        params=(
            STUDY,
            OUTPUT,
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        data=lambda result: result.results.validation,
        document="validate.page:validation_document",
        shown=lambda result: (result.results,),
        ends=_end,
    ),
    sections=(
        Section(
            "validation", "Validation, and what was not tested", "validate.page:validation", optional=True, place=160
        ),
        Section(
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
