"""The HTML page of a result, or of a run folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from femtune.steps.step import (
    FILE,
    JSON,
    Command,
    Step,
    study_of_folder,
)


def _tell(path: Any, quiet: bool) -> None:
    from femtune.files.whole_file import digest_of  # noqa: PLC0415

    if Path(path).is_file():
        click.echo(f"SHA-256 of {Path(path).name}: {digest_of(Path(path))}")
    click.echo(f"report: {Path(path).resolve()}")


STEP = Step(
    "report",
    tables=("report",),
    command=Command(
        group="First steps",
        help="Rewrite the report of a run.\n\nPATH is a run folder, or a study with a run folder.",
        params=(
            click.Argument(["path"], type=FILE, required=False, callback=study_of_folder),
            JSON,
        ),
        data=lambda path: json.dumps({"report": str(Path(path).resolve())}),
        tell=_tell,
    ),
)
