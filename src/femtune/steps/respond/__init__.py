"""Frequency responses, complex modes, static displacements."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from femtune.steps.step import (
    EIGENSOLVER,
    FILE,
    FRESH,
    JSON,
    SCATTER,
    Command,
    InRun,
    Page,
    ReportSection,
    Step,
    given_words,
)


def _asked(options: dict[str, Any], path: Path) -> dict[str, Any]:
    """Noise that is not given has its default in the function."""
    noise = {key: value for key in ("scatter", "floor", "seed") if (value := options.pop(key)) is not None}
    return {**noise, **given_words(options, path)}


STEP = Step(
    "respond",
    tables=("response", "load"),
    in_run=(
        InRun("respond", "respond.in_run:respond_before", 40),
        InRun("respond", "respond.in_run:respond_as_written", 210, with_deck=True),
        InRun("respond", "respond.in_run:respond_after", 210, with_deck=False),
    ),
    command=Command(
        group="Model",
        help=(
            "Compute frequency responses, complex modes and static displacements.\n\n"
            "PATH is a study file (.toml) or a Nastran deck. Options replace keys of [response] in the "
            "study."
        ),
        params=(
            click.Argument(["path"], type=FILE),
            click.Option(
                ["--input", "inputs"], multiple=True, metavar="12Z+", help="Excited DOF of the model; repeatable."
            ),
            click.Option(
                ["--output", "outputs"], multiple=True, metavar="13Z+", help="Response DOF of the model; repeatable."
            ),
            click.Option(["--from", "from_hz"], type=float, metavar="HZ", help="First frequency line."),
            click.Option(["--to", "to_hz"], type=float, metavar="HZ", help="Last frequency line."),
            click.Option(["--step", "step_hz"], type=float, metavar="HZ", help="Spacing of the frequency lines."),
            click.Option(["--lines"], type=int, help="Number of lines, instead of --step."),
            click.Option(["--kind"], metavar="KIND", help="receptance, mobility or accelerance."),
            click.Option(["--method"], metavar="WAY", help='"real modes", "complex modes" or direct.'),
            click.Option(["--modes"], type=int, help="Number of modes in the superposition."),
            click.Option(["--max-hz"], type=float, metavar="HZ", help="Superpose the modes up to this frequency."),
            click.Option(["--ratio"], type=float, help="Damping ratio of all modes, instead of SDAMPING."),
            click.Option(["--damping"], metavar="WORD", help="deck, or modal (ignores loss factors and dashpots)."),
            click.Option(["--uff"], type=FILE, metavar="FILE", help="Write the functions to a Universal File (58)."),
            click.Option(
                ["--scatter"], type=SCATTER, metavar="PART", help="For --uff: noise relative to the magnitude."
            ),
            click.Option(
                ["--floor"], type=SCATTER, metavar="PART", help="For --uff: noise relative to the largest magnitude."
            ),
            click.Option(["--seed"], type=click.IntRange(min=0), help="For --uff: seed of the noise.  [default: 1]"),
            click.Option(
                ["--units"], metavar="m-kg-s", help="Units, if a deck is given instead of a study; for --uff."
            ),
            click.Option(
                ["--report", "page"], type=FILE, metavar="PAGE", help="Write an HTML page with plots of the responses."
            ),
            EIGENSOLVER,
            FRESH,
            JSON,
        ),
        asked=_asked,
        data=lambda result: result.records,
        shown=lambda result: (result.records,),
        document="respond.page:responses_document",
    ),
    sections=(ReportSection("responses", "Responses", "respond.page:responses", optional=True, place=80),),
    page=Page(
        record="responses",
        genre="Responses",
        verdict="respond.page:responses_verdict",
        sections=(
            ReportSection("frequency_responses", "Frequency responses", "respond.page:frequency_responses"),
            ReportSection("complex_modes", "Complex modes", "respond.page:complex_modes"),
            ReportSection("static_loads", "Static loads", "respond.page:static_loads"),
            ReportSection("provenance", "Provenance", "run.page.method:provenance"),
        ),
    ),
)
