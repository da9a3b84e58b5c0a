"""Facts and checks of the model."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import click

from femtune.errors import printable
from femtune.steps.step import (
    FILE,
    JSON,
    Command,
    ReportSection,
    Step,
)


def _solvers(asked: dict[str, Any], as_json: bool) -> bool:
    """List the solvers if that is asked; a path is needed otherwise."""
    if not asked.pop("solvers"):
        if asked["path"] is None:
            raise click.UsageError("give a study or a deck, or use --solvers")
        return False
    from femtune.model.solvers.listing import solver_list, solver_table  # noqa: PLC0415

    solvers = solver_list()
    click.echo(printable(json.dumps([asdict(s) for s in solvers], indent=1) if as_json else solver_table(solvers)))
    return True


STEP = Step(
    "info",
    tables=("checks",),
    command=Command(
        group="Model",
        help=(
            "Summary of the deck: cards, mass, rigid-body check, supports, shapes of elements, mesh "
            "errors.\n\n"
            "PATH is a study file (.toml) or a Nastran deck."
        ),
        params=(
            click.Argument(["path"], type=FILE, required=False),
            click.Option(
                ["--solvers"], is_flag=True, help="List the sparse solvers, their availability and capabilities."
            ),
            JSON,
        ),
        instead=_solvers,
        all_remarks=False,
        document="info.terminal:info_document",
    ),
    sections=(ReportSection("checks", "Model checks", "info.page:checks", place=170),),
)
