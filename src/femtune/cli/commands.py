"""The group of commands: one for each step, as its folder declares it, and two others.

What they do is in the library; it is imported when a command runs, so that help is quick.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import click

from femtune import __version__
from femtune.cli import output as out
from femtune.cli.guard import GuardedGroup
from femtune.cli.log import be_verbose, log_to
from femtune.cli.running import run_step
from femtune.errors import codes, did_you_mean, explanation, meaning, printable
from femtune.steps import all_steps
from femtune.steps.exit_codes import exit_code_help
from femtune.steps.step import FILE, Command, Step

_HELP = """\
Finite element model updating: from a vibration test and a deck to an updated deck.

`femtune init DECK TEST` writes a study, `femtune run` updates the model and writes a report."""


@click.group(
    cls=GuardedGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=_HELP,
    epilog=exit_code_help(),
)
@click.version_option(__version__, prog_name="femtune")
def main() -> None:
    """The group of commands."""


# ----------------------------------------------------------------------------------------------------
# The commands of the steps.


_HOW_MUCH_IS_TOLD = (
    click.Option(
        ["--quiet"], is_flag=True, help="Print neither progress nor tables; warnings appear on standard error."
    ),
    click.Option(
        ["-v", "--verbose"], is_flag=True, expose_value=False, callback=be_verbose,
        help="Print every step, with its time, on standard error.",
    ),
    click.Option(
        ["--log"], type=FILE, metavar="FILE", expose_value=False, callback=log_to, is_eager=True,
        help="Append steps, warnings and errors, with their times, to a file.",
    ),
)  # fmt: skip
"""Options of every step."""


def command_of(step: Step, command: Command) -> click.Command:
    """The command of a step."""
    params = [*command.params, *_HOW_MUCH_IS_TOLD]
    return click.Command(step.name, params=params, help=command.help, callback=partial(_run, step, command))


def _run(step: Step, command: Command, *, quiet: bool, as_json: bool = False, **options: Any) -> None:
    """Run a step and show its result."""
    if command.instead is not None and command.instead(options, as_json):
        return
    path, page = options.pop(str(command.params[0].name)), options.get("page")
    if "page" in options:
        options["report"] = options.pop("page")
    result = run_step(step, path, quiet, read=command.reads, **command.asked(options, path))
    if command.tell is None:
        remark: Callable[[Any, bool], None] = out.say if command.all_remarks else out.warn
        remark(result, quiet)
    _show(command, path, result, as_json=as_json, quiet=quiet)
    end = command.ends(result)
    if end.told:
        click.echo(end.told, err=True)
    if command.last is not None and (command.whole_run or not as_json):
        click.echo(printable(command.last(result)), err=as_json)
    out.name_page(page if command.page_of is None else command.page_of(result), as_json)
    if end.code:
        click.get_current_context().exit(end.code)


def _show(command: Command, path: Path, result: Any, *, as_json: bool, quiet: bool) -> None:
    """A result as JSON, or as text or tables."""
    if as_json:
        click.echo(out.as_text(command.data(result)))
    elif command.tell is not None:
        command.tell(result, quiet)
    elif command.whole_run:
        out.show_run(result, quiet)
    elif not quiet:
        out.show(command, path, result)


for _step in all_steps():
    if _step.command is not None:
        main.add_command(command_of(_step, _step.command))
        main.group_of[_step.name] = _step.command.group


# ----------------------------------------------------------------------------------------------------
# The commands that explain.


@main.command()
@click.argument("kind", type=click.Choice(["study", "identify"]), default="study")
def schema(kind: str) -> None:
    """JSON Schema of the study file, or of the identification file, for editors."""
    from femtune.files.study_file.json_schema import schema_text  # noqa: PLC0415

    click.echo(schema_text(kind), nl=False)


def _codes_that_begin(context: click.Context, argument: click.Parameter, begun: str) -> list[str]:
    """Codes for the completion of a shell."""
    return [code for code in codes() if code.startswith(begun.lstrip("["))]


@main.command()
@click.argument("code", shell_complete=_codes_that_begin)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on standard output.")
def explain(code: str, as_json: bool) -> None:
    """Explain the code of an error or notice, and how to fix it.

    CODE is what a message shows in brackets: deck.missing-include.
    """
    code, known = code.strip("[]"), codes()
    if code not in known:
        close = did_you_mean(code, known)
        hint = close if close.startswith("did") else "codes have the form deck.missing-include"
        raise click.BadParameter(f"'{printable(code)}' is not the code of a message; {hint}", param_hint="CODE")
    click.echo(json.dumps({"code": code, **meaning(code)}) if as_json else f"[{code}]\n\n{explanation(code)}")
