"""Modes of two models of one structure."""

from __future__ import annotations

import click

from femtune.steps.step import (
    FILE,
    JSON,
    Command,
    Step,
)

STEP = Step(
    "compare",
    command=Command(
        group="Model",
        help=(
            "Compare the modes of two decks of one structure with different meshes: MAC, pairs, "
            "frequencies.\n\n"
            "The FIRST deck takes the place of the test."
        ),
        params=(
            click.Argument(["first"], type=FILE),
            click.Argument(["second"], type=FILE),
            click.Option(["--count"], type=int, help="Number of modes."),
            click.Option(["--units"], metavar="UNITS", help="Units of both decks: length-mass-s."),
            click.Option(
                ["--tolerance"], type=float, metavar="LENGTH", help="Largest distance of two points that are compared."
            ),
            click.Option(["--points"], type=int, default=300, show_default=True, help="Number of points at most."),
            JSON,
        ),
        data=lambda result: result.records,
        document="correlate.terminal:correlation_document",
        shown=lambda result: (result.records, result.arrays),
    ),
)
