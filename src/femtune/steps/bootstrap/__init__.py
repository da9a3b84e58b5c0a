"""Spread of the updated parameters by a bootstrap of the measured FRFs."""

from __future__ import annotations

from typing import Any

from femtune.steps.step import (
    EIGENSOLVER,
    FRESH,
    JOBS,
    JSON,
    OUTPUT,
    STUDY,
    Command,
    End,
    InRun,
    ReportSection,
    Step,
    end_of_update,
)


def _end(result: Any) -> End:
    end = end_of_update(result)
    return End(end.told, 1) if result.results.bootstrap is None else end


STEP = Step(
    "bootstrap",
    tables=("bootstrap",),
    in_run=(InRun("bootstrap", "bootstrap.in_run:bootstrap_after", 160, optional="bootstrap"),),
    command=Command(
        group="Uncertainty",
        help=(
            "Spread of the updated parameters by a bootstrap of the measured FRFs.\n\n"
            "The model is updated first, as by `update`. An interrupted bootstrap continues from the runs "
            "that had ended. The exit code is 1 if the update did not reach an optimum."
        ),
        params=(
            STUDY,
            OUTPUT,
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        data=lambda result: result.results.bootstrap,
        document="bootstrap.page:bootstrap_document",
        shown=lambda result: (result.results,),
        ends=_end,
    ),
    sections=(
        ReportSection(
            "bootstrap",
            "Bootstrap of the FRFs",
            "bootstrap.page:bootstrap",
            intro=(
                "Each run repeats the update on other data of the same test. The scatter of the runs is the "
                "uncertainty that follows from the measured FRFs themselves."
            ),
            optional=True,
            place=150,
        ),
    ),
)
