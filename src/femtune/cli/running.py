"""How a command runs a step: its file is checked before numpy is imported; then the step, with a progress display."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from femtune.cli.guard import Running
from femtune.cli.log import is_verbose
from femtune.steps.step import JOBS_KEY, NamedFile, Step, load, study_of


def run_step(
    step: Step, path: Path, quiet: bool, *, read: Callable[[Path], NamedFile | None] = study_of, **options: Any
) -> Any:
    """What the function of a step returns.

    Parameters
    ----------
    step : the step
    path : the file that the user named
    read : checks it; its errors are reported before the step and numpy are imported
    options : those of the function
    """
    context, output = click.get_current_context().find_root(), options.get("output")
    context.obj = Running(output or path)
    file = read(path)
    if file is not None and not output:
        context.obj = Running(file.output_folder)
    jobs = context.meta.get(JOBS_KEY)
    if jobs is not None:
        options["jobs"] = jobs
    function = load(step.function)
    # rich takes a while to import
    from femtune.cli.display import Display  # noqa: PLC0415

    with Display(quiet or is_verbose(context)) as progress:
        return function(path, progress=progress, **options)
