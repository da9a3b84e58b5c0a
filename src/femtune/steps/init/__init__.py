"""A first study from a deck and a test."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from femtune.errors import printable
from femtune.steps.step import (
    CHOICES,
    FILE,
    JSON,
    Command,
    Step,
    no_file,
)


def _tell(result: Any, quiet: bool) -> None:
    if not quiet:
        click.echo(printable(result.overview))


class _Vector(click.ParamType):
    """Three numbers separated by commas."""

    name = "vector"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        try:
            return tuple(float(word) for word in str(value).split(","))
        except ValueError:
            self.fail(f"{value!r} is not three numbers separated by commas, such as 0.3,0.2,0", param, ctx)


_VECTOR = _Vector()

STEP = Step(
    "init",
    command=Command(
        group="First steps",
        help=(
            "Write a commented study from a deck and a test: units, sensors, modes and parameters are "
            "proposed.\n\n"
            "TEST is a Universal File with modes or FRFs, a table of mode shapes, or a record, from which the modes "
            "are identified first. FOLDER is the current folder by default; it receives study.toml."
        ),
        params=(
            click.Argument(["deck"], type=FILE),
            click.Argument(["test"], type=FILE),
            click.Argument(["folder"], type=FILE, default=".", required=False),
            click.Option(["--units"], metavar="m-kg-s", help="Units of the deck, instead of guessing them."),
            click.Option(
                ["--origin"],
                metavar="X,Y,Z",
                type=_VECTOR,
                help="Position of the origin of the test in the model, instead of finding it.",
            ),
            click.Option(["--tolerance"], type=float, help="Largest distance of a test point from its grid point."),
            click.Option(["--by-id"], is_flag=True, help="Test points have the numbers of their grid points."),
            CHOICES,
            click.Option(["--force"], is_flag=True, help="Replace files that are there."),
            JSON,
        ),
        reads=no_file,
        tell=_tell,
        last=lambda result: f"study: {Path(result.path).resolve()}",
    ),
)
