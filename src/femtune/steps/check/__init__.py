"""All mistakes of a study at once."""

from __future__ import annotations

from typing import Any

import click

from femtune.errors import printable
from femtune.steps.exit_codes import BAD_INPUT
from femtune.steps.step import (
    FILE,
    JSON,
    Command,
    End,
    Step,
    coloured,
    no_file,
    study_of_folder,
)


def _tell(result: Any, quiet: bool) -> None:
    for said in (*result.errors, *result.remarks):
        click.echo(f"{coloured(said)}\n", err=True)
    if not quiet:
        click.echo(printable(repr(result).partition("\n")[0].partition(": ")[2]))


STEP = Step(
    "check",
    command=Command(
        group="First steps",
        help=(
            "All mistakes of a study, of its deck and of its tests at once; nothing is solved.\n\n"
            "PATH is a study file (.toml) or a Nastran deck. The exit code is 2 if there are errors."
        ),
        params=(
            click.Argument(["path"], type=FILE, required=False, callback=study_of_folder),
            JSON,
        ),
        reads=no_file,
        tell=_tell,
        ends=lambda result: End() if result.ok else End(code=BAD_INPUT),
    ),
)
