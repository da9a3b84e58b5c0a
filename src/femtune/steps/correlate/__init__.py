"""Test against model: pairs, frequency errors, MAC, expansion of test shapes."""

from __future__ import annotations

import click

from femtune.steps.step import (
    CHOICES,
    EIGENSOLVER,
    FILE,
    FRESH,
    JSON,
    STRICT,
    STUDY,
    Command,
    InRun,
    Page,
    ReportSection,
    Step,
    end_of_judged,
)

STEP = Step(
    "correlate",
    tables=("correlate",),
    in_run=(
        InRun("correlate", "correlate.in_run:correlate_before", 20),
        InRun("correlate after", "correlate.in_run:correlate_after", 90),
        InRun("correlate as written", "correlate.in_run:correlate_as_written", 180, with_deck=True),
        InRun("expanded shapes", "correlate.in_run:write_expanded", 200, optional="file of the expanded test shapes"),
    ),
    command=Command(
        group="Model and test",
        help=(
            "Compare the model with the test: frequencies, MAC, mode pairs.\n\n"
            "The exit code is 4 if the verdict is: not accepted."
        ),
        params=(
            STUDY,
            click.Option(
                ["--expand"], metavar="METHOD", help="Expand the test shapes to the model: serep, dynamic or mdre."
            ),
            click.Option(
                ["--uff"], type=FILE, metavar="FILE", help="Write the expanded shapes to a Universal File (55)."
            ),
            CHOICES,
            click.Option(
                ["--report", "page"],
                type=FILE,
                metavar="PAGE",
                help="Write an HTML page with a first page to sign.",
            ),
            EIGENSOLVER,
            FRESH,
            STRICT,
            JSON,
        ),
        data=lambda result: result.records,
        document="correlate.terminal:correlation_document",
        shown=lambda result: (result.records, result.arrays),
        ends=lambda result: end_of_judged(result.judgement),
    ),
    sections=(
        ReportSection(
            "compared",
            "What was compared",
            "correlate.page.compared:compared",
            intro=(
                "The test and the model were compared at the measured degrees of freedom. Modes that the "
                "study leaves out are listed with the reason."
            ),
            place=20,
        ),
        ReportSection(
            "expansion",
            "Expanded test shapes",
            "correlate.page.expansion:expansion",
            intro=(
                "The measured shapes are expanded to all grid points of the model. The error at sensors that "
                "are left out and predicted from the others estimates the error at points without a sensor."
            ),
            optional=True,
            place=50,
        ),
        ReportSection(
            "mac",
            "MAC matrices",
            "correlate.page.correlation:mac",
            intro=(
                "Rows are test modes and columns are model modes. Rigid-body modes of the model that have no "
                "partner are not shown. Framed cells are pairs."
            ),
            optional=True,
            place=60,
        ),
        ReportSection(
            "comac",
            "COMAC",
            "correlate.page.correlation:comac",
            intro=(
                "COMAC measures the agreement at each measured degree of freedom over all paired modes. A "
                "single low value indicates a local modelling error, or a sensor whose position, direction or "
                "label is incorrect. The table shows the enhanced COMAC (eCOMAC) and the change of the MAC "
                "when a degree of freedom is left out."
            ),
            optional=True,
            place=70,
        ),
    ),
    page=Page(
        record="judgement",
        genre="Correlation report",
        verdict="judge.page:judgement_verdict",
        sections=(
            ReportSection("summary", "Summary", "run.page.review:comparison"),
            ReportSection("judgement", "Reasons for the verdict", "judge.page:judgement"),
            ReportSection("compared", "What was compared", "correlate.page.compared:compared"),
            ReportSection("modes", "Modes", "modes.page.modes:modes"),
            ReportSection("mode_shapes", "Mode shapes", "modes.page.mode_shapes:mode_shapes"),
            ReportSection("expansion", "Expanded test shapes", "correlate.page.expansion:expansion"),
            ReportSection("mac", "MAC matrices", "correlate.page.correlation:mac"),
            ReportSection("comac", "COMAC", "correlate.page.correlation:comac"),
            ReportSection("checks", "Model checks", "info.page:checks"),
            ReportSection("criteria", "Acceptance criteria", "validate.page:criteria"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
