"""The minimum of the residuals in the whole box."""

from __future__ import annotations

import click

from femtune.steps.step import EIGENSOLVER, FILE, FRESH, JOBS, JSON, STUDY, Command, Page, ReportSection, Step

STEP = Step(
    "search",
    tables=("search",),
    command=Command(
        help=(
            "Search the whole box for the minimum of the residuals, and confirm it on the model.\n\n"
            "Options replace keys of [search] in the study. `update` writes the updated deck."
        ),
        params=(
            STUDY,
            click.Option(["--on"], metavar="WORD", help="surrogate, or model."),
            click.Option(
                ["--runs"], type=int, help="Runs of the model for the surrogate; ten per parameter by default."
            ),
            click.Option(["--infill"], type=int, help="Further runs for the surrogate."),
            click.Option(["--infill-by"], metavar="WORD", help="Where further runs are made: improvement, or error."),
            click.Option(
                ["--infill-until"], type=float, help="Of error: error of the surrogate at which further runs end."
            ),
            click.Option(["--surrogate"], metavar="NAME", help="kriging, radial-basis or chaos."),
            click.Option(["--method"], metavar="NAME", help="differential-evolution, genetic or cma-es."),
            click.Option(["--population"], type=int, help="Points of a generation."),
            click.Option(["--generations"], type=int, help="The most generations."),
            click.Option(["--seeds"], type=int, help="Number of searches from different seeds."),
            click.Option(["--front"], type=int, help="Points of the front of frequency errors against other errors."),
            click.Option(["--csv"], type=FILE, metavar="FILE", help="Write a table of the front."),
            click.Option(
                ["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with tables and a picture."
            ),
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        document="search.page:search_document",
    ),
    page=Page(
        record="search",
        genre="Global search",
        verdict="search.page:search_verdict",
        sections=(
            ReportSection("search_summary", "Global search", "search.page:search_summary"),
            ReportSection(
                "search_parameters",
                "Parameters",
                "search.page:search_parameters",
                intro=(
                    "Found: where the search of the whole box ended. Value: after least squares on the model that "
                    "start there."
                ),
            ),
            ReportSection("search_convergence", "Convergence", "search.page:search_convergence"),
            ReportSection("search_front", "Frequencies against shapes", "search.page:search_front"),
            ReportSection("search_surrogate", "Surrogate", "search.page:search_surrogate"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
