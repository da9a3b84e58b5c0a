"""A moving mode in a window."""

from __future__ import annotations

from typing import Any

import click

from femtune.steps.step import (
    EIGENSOLVER,
    FILE,
    FRESH,
    Command,
    Step,
)


def _tell(picture: Any, quiet: bool) -> None:
    if picture is not None:
        click.echo(f"picture: {picture}")


STEP = Step(
    "view",
    command=Command(
        group="Model",
        help=(
            "Show a moving mode in a window, or write a picture of it.\n\n"
            "PATH is a study file (.toml) or a Nastran deck."
        ),
        params=(
            click.Argument(["path"], type=FILE),
            click.Option(
                ["--mode"], type=int, metavar="N", help="Mode that is shown first; default: the first elastic mode."
            ),
            click.Option(["--configuration"], metavar="NAME", help="Configuration of a study; default: the first."),
            click.Option(["--count"], type=int, help="Number of modes, instead of that of the study or deck."),
            click.Option(
                ["--max-hz"], type=float, metavar="HZ", help="All modes up to this frequency, instead of --count."
            ),
            click.Option(["--picture"], type=FILE, metavar="FILE", help="Write a picture (.png) and open no window."),
            click.Option(
                ["--draws"],
                type=int,
                metavar="N",
                help="Modes at N samples of the posterior in the study's run folder.",
            ),
            EIGENSOLVER,
            FRESH,
        ),
        tell=_tell,
    ),
)
