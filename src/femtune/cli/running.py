"""How a command runs a step: its file is checked before numpy is imported; then the step, with a progress display."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import click

from femtune.cli.guard import Running
from femtune.cli.log import is_verbose

_JOBS = "femtune.jobs"


class NamedFile(Protocol):
    """A study or an identification file, as far as the command line looks at it."""

    @property
    def output_folder(self) -> Path:
        """Where results go."""
        ...


def load(name: str) -> Callable[..., Any]:
    """The function that ``module:function`` names, imported now."""
    module, _, function = name.partition(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found


def study_of(path: Path) -> NamedFile | None:
    """The study file at `path`; None for a deck or a folder (errors of `femtune.files.study_file.read_study_file`)."""
    from femtune.files.study_file.reading import is_deck, read_study_file  # noqa: PLC0415

    return None if is_deck(path) or path.is_dir() else read_study_file(path)


def identification_of(path: Path) -> NamedFile | None:
    """The identification file at `path`; None for a record or functions (errors of `read_identify_file`)."""
    from femtune.files.identification_file import is_identification_file, read_identify_file  # noqa: PLC0415

    return read_identify_file(path) if is_identification_file(path) else None


def keep_jobs(context: click.Context, option: click.Parameter, jobs: int | None) -> None:
    """Keep the number of runs at a time for the step of this command."""
    context.find_root().meta[_JOBS] = jobs


def no_file(path: Path) -> NamedFile | None:
    """None: the step itself tells what is wrong with its files."""
    return None


def run_step(
    step: str, path: Path, quiet: bool, *, read: Callable[[Path], NamedFile | None] = study_of, **options: Any
) -> Any:
    """What a function of `femtune.steps` returns.

    Parameters
    ----------
    step : ``module:function`` below `femtune.steps`
    path : the file that the user named
    read : checks it; its errors are reported before the step and numpy are imported
    options : those of the function
    """
    context, output = click.get_current_context().find_root(), options.get("output")
    context.obj = Running(output or path)
    file = read(path)
    if file is not None and not output:
        context.obj = Running(file.output_folder)
    jobs = context.meta.get(_JOBS)
    if jobs is not None:
        options["jobs"] = jobs
    function = load(f"femtune.steps.{step}")
    # rich takes a while to import
    from femtune.cli.display import Display  # noqa: PLC0415

    with Display(quiet or is_verbose(context)) as progress:
        return function(path, progress=progress, **options)
