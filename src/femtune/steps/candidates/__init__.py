"""Several sets of parameters, updated and compared."""

from __future__ import annotations

import click

from femtune.steps.step import EIGENSOLVER, FILE, FRESH, JOBS, JSON, OUTPUT, STUDY, Command, Page, ReportSection, Step

STEP = Step(
    "candidates",
    tables=("candidates", "candidate"),
    command=Command(
        help=(
            "Update several sets of parameters and compare these candidate models.\n\n"
            "The sets are those of [[candidate]] and [candidates] in the study. An interrupted comparison "
            "continues from the candidates that had ended."
        ),
        params=(
            STUDY,
            OUTPUT,
            click.Option(
                ["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with tables and a picture."
            ),
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        document="candidates.page:candidates_document",
    ),
    page=Page(
        record="candidates",
        genre="Candidate models",
        verdict="candidates.page:candidates_verdict",
        sections=(
            ReportSection("candidates_summary", "Candidate models", "candidates.page:candidates_summary"),
            ReportSection(
                "candidates_table",
                "Criteria",
                "candidates.page:candidates_table",
                intro=(
                    "The mean error is the weighted mean of all compared quantities. BIC is given relative to the "
                    "smallest. The prediction is the mean error of configurations that were left out of the "
                    "update, one at a time. The largest residual is in its stated standard deviations."
                ),
            ),
            ReportSection(
                "candidates_parameters",
                "Parameters",
                "candidates.page:candidates_parameters",
                intro=(
                    "Values at the optimum of each candidate, ± standard deviation. Values that are updated are "
                    "in plain text; = marks a tied parameter, · an initial value, and ! a value at its bound."
                ),
            ),
            ReportSection(
                "candidates_distances",
                "Distances",
                "candidates.page:candidates_distances",
                intro="Root mean square difference of all parameters, relative to their initial values, in %.",
            ),
            ReportSection(
                "candidates_instances",
                "Instances that are not falsified",
                "candidates.page:candidates_instances",
                intro=(
                    "Instances are drawn within the bounds; one with a residual above the limit is falsified. Where "
                    "few are left, further ones are drawn near a point that is not falsified. The ranges are those of "
                    "all that are left, and of what they predict."
                ),
                optional=True,
            ),
            ReportSection(
                "candidates_undetermined", "What the data do not determine", "candidates.page:candidates_undetermined"
            ),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
