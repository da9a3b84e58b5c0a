"""Declaration of a step: its command, its sections of the report, its own page.

The `STEP` of each folder is read by the command line, which makes a command of it, and by the report, which orders
sections by their `place`. Functions of a step are named as ``module:function`` below `femtune.steps` and imported only
when the step runs, so that the help of the command line stays quick.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Protocol

import click

from femtune.errors import printable
from femtune.steps.exit_codes import ENDED, NO_OPTIMUM, NOT_ACCEPTED, RESERVATIONS

if TYPE_CHECKING:
    from femtune.errors import FemtuneError, Notice
    from femtune.steps.judge.record.judgement import JudgementResults


class NamedFile(Protocol):
    """A study or an identification file, as far as a command looks at it."""

    @property
    def output_folder(self) -> Path:
        """Where results go."""
        ...


def load(name: str) -> Callable[..., Any]:
    """The function that ``module:function`` below `femtune.steps` names, imported now."""
    module, _, function = name.partition(":")
    loaded: Callable[..., Any] = getattr(import_module(f"femtune.steps.{module}"), function)
    return loaded


def study_of(path: Path) -> NamedFile | None:
    """The study file at `path`; None for a deck or a folder (errors of `femtune.files.study_file.read_study_file`)."""
    from femtune.files.study_file.reading import is_deck, read_study_file  # noqa: PLC0415

    return None if is_deck(path) or path.is_dir() else read_study_file(path)


def identification_of(path: Path) -> NamedFile | None:
    """The identification file at `path`; None for a record or functions (errors of `read_identify_file`)."""
    from femtune.files.identification_file import is_identification_file, read_identify_file  # noqa: PLC0415

    return read_identify_file(path) if is_identification_file(path) else None


def no_file(path: Path) -> NamedFile | None:
    """None: the step itself reports what is wrong with its files."""
    return None


_COLOURS = {"info": "blue", "warning": "yellow", "problem": "red"}
"""Colours of the levels of messages, as on the pages."""


def coloured(said: FemtuneError | Notice) -> str:
    """A message with its code in the colour of its level, unless NO_COLOR is set; click removes it from files."""
    colour = None if os.environ.get("NO_COLOR") else _COLOURS[getattr(said, "level", "problem")]
    return said.text(lambda code: click.style(code, fg=colour, bold=True))


@dataclass(frozen=True)
class End:
    """How a command ends: a sentence on standard error, "" for none, and the exit code."""

    told: str = ""
    code: int = 0


def end_of_update(result: Any) -> End:
    """The end of an update: it fails if no optimum was reached."""
    update = result.results.update
    return End() if update is None or update.ok else End(f"{update.status}: {update.message}", NO_OPTIMUM)


_TOLD_WIDTH = 80
"""Columns of the verdict on standard error: those of a terminal."""


def end_of_judged(judgement: JudgementResults | None) -> End:
    """The end of a step with a verdict: the verdict with all its reasons, and its exit code."""
    if judgement is None:
        return End()
    told = [fill(judgement.line, _TOLD_WIDTH)]
    told += [fill(r.text, _TOLD_WIDTH, initial_indent="  - ", subsequent_indent="    ") for r in judgement.reasons]
    reserved = RESERVATIONS if click.get_current_context().find_root().meta.get(_STRICT_KEY) else ENDED
    codes = {"accepted": ENDED, "accepted with reservations": reserved, "not accepted": NOT_ACCEPTED}
    return End(printable("\n".join(told)), codes[judgement.verdict])


def as_given(options: dict[str, Any], path: Path) -> dict[str, Any]:
    """The options as they are."""
    return options


def given_words(options: dict[str, Any], path: Path) -> dict[str, Any]:
    """Options that are keys of a table; one that may be repeated and was not given is None."""
    return {key: (value or None) if isinstance(value, tuple) else value for key, value in options.items()}


@dataclass(frozen=True)
class Command:
    """The command of a step.

    Parameters
    ----------
    help : description of the command; paragraphs are separated by a blank line
    params : arguments and options; the first argument is the file that the step reads
    function : what runs, ``module:function``; that of the front door by default
    reads : checks that file before numpy is imported
    instead : does something else if the options ask for that, and returns True then
    asked : keywords of the function, from the options
    all_remarks : show the remarks of the result, not only its alerts
    data : what ``--json`` prints: a record, several records, or text
    document : makes the tables for the terminal, from the subject and what `shown` gives; "" without tables
    shown : arguments of `document` after the subject; None: the result alone, without a subject
    tell : prints the result in place of tables, with its remarks
    whole_run : the short form of the report is shown
    page_of : the page that was written, if the step always writes one
    last : the last line on standard output
    ends : sentence and exit code at the end
    group : heading of the help of femtune under which the command stands
    """

    help: str
    params: tuple[click.Parameter, ...]
    function: str = ""
    reads: Callable[[Path], NamedFile | None] = study_of
    instead: Callable[[dict[str, Any], bool], bool] | None = None
    asked: Callable[[dict[str, Any], Path], dict[str, Any]] = as_given
    all_remarks: bool = True
    data: Callable[[Any], Any] = lambda result: result.record
    document: str = ""
    shown: Callable[[Any], tuple[Any, ...]] | None = lambda result: (result.record,)
    tell: Callable[[Any, bool], None] | None = None
    whole_run: bool = False
    page_of: Callable[[Any], Path | None] | None = None
    last: Callable[[Any], str] | None = None
    ends: Callable[[Any], End] = lambda result: End()
    group: str = "Parameters"


@dataclass(frozen=True)
class ReportSection:
    """A section of a page.

    Parameters
    ----------
    id : its key in the page
    title : its heading
    blocks : makes its blocks from the results, ``module:function``
    intro : opening words
    optional : folded if the step did not run, and left out if it has no blocks
    place : position in the report of a run; sections of a step's own page are in the order of the page
    """

    id: str
    title: str
    blocks: str
    intro: str = ""
    optional: bool = False
    place: int = 0


@dataclass(frozen=True)
class Page:
    """The page of a step that runs alone.

    Parameters
    ----------
    record : field of the results with the record of the step
    genre : what the page is, in words
    verdict : sentence and level from the record, ``module:function``
    sections : its sections, in their order
    """

    record: str
    genre: str
    verdict: str
    sections: tuple[ReportSection, ...]


@dataclass(frozen=True)
class InRun:
    """A part of `femtune run`.

    Parameters
    ----------
    name : under which its time is kept
    work : ``module:function``, its outcome from those of earlier parts; None if it has none. Arrays and files are
        entered as made
    place : position in the run
    optional : what it finds, in words, if the run goes on without it; "" if its failure ends the run
    with_deck : True for a run that writes an updated deck, False for one that writes none; None for both
    """

    name: str
    work: str
    place: int
    optional: str = ""
    with_deck: bool | None = None


@dataclass(frozen=True)
class Step:
    """A step of a project.

    Parameters
    ----------
    name : name of its folder, of its command and of its function
    tables : tables of the study file with its options; the module of their class in `femtune.files.study_file` has the
        name of the step or of the table
    in_run : its parts of `femtune run`
    command : its command; None for a step that is part of a run only
    sections : its sections of the report of a run
    page : its page if it runs alone; None without one
    """

    name: str
    tables: tuple[str, ...] = ()
    in_run: tuple[InRun, ...] = ()
    command: Command | None = None
    sections: tuple[ReportSection, ...] = ()
    page: Page | None = None

    @property
    def function(self) -> str:
        """What the command runs, as ``module:function``."""
        return (self.command and self.command.function) or f"{self.name}.function:{self.name}"


_VARIABLE = "FEMTUNE_EIGENSOLVER"


def choose_eigensolver(context: click.Context, option: click.Parameter, name: str | None) -> None:
    """Set the environment variable that the model reads, until the command ends."""
    if name is not None:
        context.with_resource(_set(name))


@contextmanager
def _set(name: str) -> Iterator[None]:
    before = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = before


class _FilePath(click.Path):
    """A path that is no pipe and no device: reading these may never end."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, refused for what is there and is neither a file nor a folder."""
        path = super().convert(value, param, ctx)
        try:
            mode = os.stat(path).st_mode
        except (OSError, ValueError):
            return path
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            self.fail(f"{printable(str(value))!r} is a pipe or a device, not a file", param, ctx)
        return path


FILE = _FilePath(path_type=Path)
SCATTER = click.FloatRange(min=0.0, max=1.0)

_STRICT_KEY = "femtune.strict"
"""Where the context of a command keeps whether reservations count."""


def keep_strict(context: click.Context, option: click.Parameter, strict: bool) -> None:
    """Keep whether reservations have an exit code of their own."""
    context.find_root().meta[_STRICT_KEY] = strict


JOBS_KEY = "femtune.jobs"
"""Where the context of a command keeps the number of runs at a time."""


def keep_jobs(context: click.Context, option: click.Parameter, jobs: int | None) -> None:
    """Keep the number of runs at a time for the step of this command."""
    context.find_root().meta[JOBS_KEY] = jobs


STUDY_FILE = "study.toml"
"""Name of the study that ``femtune init`` writes, and that a command takes if it is given none."""


def study_of_folder(context: click.Context, argument: click.Parameter, path: Path | None) -> Path:
    """The file that was given, or the study of the working folder."""
    if path is None and not Path(STUDY_FILE).is_file():
        message = f"no file was given, and this folder has no {STUDY_FILE}; `femtune init DECK TEST` writes one"
        raise click.UsageError(message, context)
    return path or Path(STUDY_FILE)


STUDY = click.Argument(["study"], type=FILE, required=False, callback=study_of_folder)
JSON = click.Option(["--json", "as_json"], is_flag=True, help="Print the result as JSON on standard output.")
OUTPUT = click.Option(["--output"], type=FILE, metavar="FOLDER", help="Run folder, instead of that of the study.")
FRESH = click.Option(["--fresh"], is_flag=True, help="Ignore the journal of an earlier run and solve everything again.")
JOBS = click.Option(
    ["--jobs"], type=click.IntRange(1, 1024), metavar="N", expose_value=False, callback=keep_jobs,
    help="Maximum number of parallel runs (overrides [parallel]).",
)  # fmt: skip
STRICT = click.Option(
    ["--strict"], is_flag=True, expose_value=False, callback=keep_strict,
    help="End with exit code 3 if the verdict is: accepted with reservations.",
)  # fmt: skip
EIGENSOLVER = click.Option(
    ["--eigensolver"], type=click.Choice(["own", "slepc"]), expose_value=False, callback=choose_eigensolver,
    help="slepc: distributed over MPI, for models too large for one machine.",
)  # fmt: skip
CHOICES = click.Option(
    ["--choices"], type=FILE, metavar="FILE", help="Choices that were made on the page of a report, as saved there.",
)  # fmt: skip
WIDE = click.Option(["--wide"], is_flag=True, default=None, help="Write changed cards in large-field format.")
