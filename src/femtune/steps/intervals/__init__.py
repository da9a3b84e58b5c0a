"""Intervals of frequencies from a box of parameters, and of parameters from limits of frequencies."""

from __future__ import annotations

import click

from femtune.steps.step import FILE, JSON, STUDY, Command, Page, ReportSection, Step

STEP = Step(
    "intervals",
    tables=("intervals",),
    command=Command(
        help=(
            "Lowest and highest frequencies of all models whose parameters lie between their bounds.\n\n"
            "With limits_hz in [intervals] of the study, the box of the parameters is sought whose extreme frequencies "
            "are these limits. No test is needed."
        ),
        params=(
            STUDY,
            click.Option(["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with the tables."),
            JSON,
        ),
        function="intervals.run:intervals",
        document="intervals.page:intervals_document",
    ),
    page=Page(
        record="intervals",
        genre="Intervals",
        verdict="intervals.page:intervals_verdict",
        sections=(
            ReportSection("intervals_box", "Box of the parameters", "intervals.page:intervals_box"),
            ReportSection("intervals_frequencies", "Frequencies", "intervals.page:intervals_frequencies"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
