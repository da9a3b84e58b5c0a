"""Sampled distribution of the parameters, with the size of the errors learned from the data."""

from __future__ import annotations

from typing import Any

import click

from femtune.steps.step import (
    EIGENSOLVER,
    FILE,
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
    return End(end.told, 1) if result.results.posterior is None else end


STEP = Step(
    "posterior",
    tables=("posterior",),
    in_run=(InRun("posterior", "posterior.in_run:posterior_after", 165, optional="posterior"),),
    command=Command(
        group="Uncertainty",
        help=(
            "Sampled distribution of the parameters, instead of standard deviations.\n\n"
            "The model is updated first, as by `update`. An interrupted run continues from the solutions that had "
            "ended. The exit code is 1 if the update did not reach an optimum, or nothing could be sampled."
        ),
        params=(
            STUDY,
            OUTPUT,
            click.Option(
                ["--report", "page"],
                type=FILE,
                metavar="PAGE",
                help="Write an HTML page with a first page to sign.",
            ),
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        data=lambda result: result.results.posterior,
        document="posterior.page:posterior_document",
        shown=lambda result: (result.results,),
        ends=_end,
    ),
    sections=(
        ReportSection(
            "posterior",
            "Posterior distribution",
            "posterior.page:posterior",
            intro=(
                "Samples of the parameters, each weighted by how well the model explains the data there. The size of "
                "the errors is learned from the data where they determine it."
            ),
            optional=True,
            place=155,
        ),
    ),
)
