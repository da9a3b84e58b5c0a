"""Mass properties of each configuration, against a budget."""

from __future__ import annotations

import click

from femtune.steps.step import FILE, JSON, STUDY, Command, End, Page, ReportSection, Step

STEP = Step(
    "weigh",
    tables=("weigh",),
    command=Command(
        help=(
            "Mass, centre of gravity and moments of inertia of each configuration.\n\n"
            "[weigh] in the study states the point of reference and the mass budget."
        ),
        params=(
            STUDY,
            click.Option(["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with the table."),
            JSON,
        ),
        function="weigh.run:weigh",
        document="weigh.page:weigh_document",
        ends=lambda result: End(code=0 if result.record.within else 1),
    ),
    page=Page(
        record="weigh",
        genre="Mass properties",
        verdict="weigh.page:weigh_verdict",
        sections=(
            ReportSection("weigh_masses", "Mass properties", "weigh.page:weigh_masses"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
