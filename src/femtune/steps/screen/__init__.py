"""Effects of the parameters by designed runs."""

from __future__ import annotations

import click

from femtune.steps.step import EIGENSOLVER, FILE, FRESH, JOBS, JSON, STUDY, Command, Page, ReportSection, Step

STEP = Step(
    "screen",
    tables=("screen",),
    command=Command(
        help=(
            "Which parameters matter for which mode, by designed runs of the model.\n\n"
            "No test is needed. Options replace keys of [screen] in the study."
        ),
        params=(
            STUDY,
            click.Option(["--design"], metavar="NAME", help="orthogonal, factorial, plackett-burman, morris, …"),
            click.Option(
                ["--array"], metavar="NAME", help='Orthogonal array: "L18", "L16 4^5" …; the smallest by default.'
            ),
            click.Option(["--levels"], type=int, help="Number of levels of each parameter between its bounds."),
            click.Option(["--trajectories"], type=int, help="Of morris: number of trajectories."),
            click.Option(["--points"], type=int, help="Of sobol: number of points, a power of two."),
            click.Option(["--on"], metavar="WORD", help="Of sobol: surrogate, or model."),
            click.Option(["--runs"], type=int, help="Of sobol: runs for the surrogate; ten per parameter by default."),
            click.Option(["--configuration"], metavar="NAME", help="The only configuration whose modes are compared."),
            click.Option(["--csv"], type=FILE, metavar="FILE", help="Write the table of runs."),
            click.Option(
                ["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with tables and a picture."
            ),
            EIGENSOLVER,
            FRESH,
            JOBS,
            JSON,
        ),
        document="screen.page:screen_document",
    ),
    page=Page(
        record="screen",
        genre="Screening of parameters",
        verdict="screen.page:screen_verdict",
        sections=(
            ReportSection("screen_summary", "Effects of the parameters", "screen.page:screen_summary"),
            ReportSection(
                "screen_contributions",
                "Contributions",
                "screen.page:screen_contributions",
                intro=(
                    "Part of the variation of each frequency over the runs that is due to each parameter, in %. "
                    "The bounds of the parameters determine it: a parameter that varies more contributes more."
                ),
                optional=True,
            ),
            ReportSection(
                "screen_variance",
                "Analysis of variance",
                "screen.page:screen_variance",
                intro=(
                    "F compares the mean square of a parameter with that of the error, which in a computed model "
                    "is what main effects do not explain. The range is the largest mean frequency of a level "
                    "minus the smallest."
                ),
                optional=True,
            ),
            ReportSection(
                "screen_elementary",
                "Elementary effects",
                "screen.page:screen_elementary",
                intro=(
                    "An elementary effect is the change of a frequency over the whole range of a parameter, taken "
                    "from a step of about half the range at one place of the box. μ is the mean over the "
                    "trajectories, μ* that of the absolute values (importance), and σ the standard deviation: it "
                    "is zero for a parameter with a linear effect without interactions."
                ),
                optional=True,
            ),
            ReportSection(
                "screen_indices",
                "Sobol's indices",
                "screen.page:screen_indices",
                intro=(
                    "Parts of the variance of each frequency, with all parameters uniformly distributed between "
                    "their bounds. The first index is what a parameter explains alone, the total index what it "
                    "explains with all interactions. The intervals are due to the choice of points, not to the "
                    "error of a surrogate."
                ),
                optional=True,
            ),
            ReportSection(
                "screen_modes",
                "Modes",
                "screen.page:screen_modes",
                intro=(
                    "Each mode is followed by its shape from the initial values to every run. A small MAC means "
                    "that it has mixed with others."
                ),
            ),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
