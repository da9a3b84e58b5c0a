"""Exit codes of the commands, declared once, for the help of the command line and the table of the guide."""

from __future__ import annotations

from dataclasses import dataclass

ENDED = 0
"""The command did what it was asked; of a judged one: the run is accepted, perhaps with reservations."""
NO_OPTIMUM = 1
"""The update did not reach an optimum."""
BAD_INPUT = 2
"""Errors in the input."""
RESERVATIONS = 3
"""Accepted with reservations, where ``--strict`` asks for none."""
NOT_ACCEPTED = 4
"""The verdict is "not accepted"."""
FAULT = 70
"""An error in femtune itself: EX_SOFTWARE of sysexits.h."""
HUNG_UP = 129
"""The terminal was closed: 128 + SIGHUP, as shells report it."""
INTERRUPTED = 130
"""Ctrl-C: 128 + SIGINT, as shells report it."""
CUT_OFF = 141
"""The reader of the output ended, such as ``head``: 128 + SIGPIPE, as shells report it."""
TERMINATED = 143
"""A request to terminate: 128 + SIGTERM."""


@dataclass(frozen=True)
class ExitCode:
    """An exit code: its number, the commands that end with it, and when they do."""

    number: int
    commands: str
    when: str


_JUDGED = "`run`, `validate`, `correlate`"
EXIT_CODES = (
    ExitCode(ENDED, _JUDGED, "*accepted*, also with reservations"),
    ExitCode(ENDED, "all others", "the command succeeded"),
    ExitCode(NO_OPTIMUM, "`update`, `bootstrap`, `posterior`", "the update did not reach an optimum"),
    ExitCode(BAD_INPUT, "all", "the input has errors"),
    ExitCode(RESERVATIONS, _JUDGED, "with `--strict`: *accepted with reservations*"),
    ExitCode(NOT_ACCEPTED, _JUDGED, "the verdict is *not accepted*"),
    ExitCode(FAULT, "all", "internal error of femtune"),
    ExitCode(HUNG_UP, "all", "SIGHUP: the terminal was closed"),
    ExitCode(INTERRUPTED, "all", "Ctrl-C"),
    ExitCode(CUT_OFF, "all", "the reader of the output ended"),
    ExitCode(TERMINATED, "all", "SIGTERM"),
)


def exit_code_help() -> str:
    """The exit codes as the help of the command line lists them; a line with a backspace keeps click from joining them.

    Examples
    --------
    >>> from femtune.steps.exit_codes import exit_code_help
    >>> exit_code_help().splitlines()[2]
    '  0  run, validate, correlate: accepted, also with reservations'
    """
    lines = (f"{e.number:>3}  {e.commands}: {e.when}" for e in EXIT_CODES)
    return "\n".join(["\b", "Exit codes:", *lines]).replace("`", "").replace("*", "")


def exit_code_table() -> str:
    """The exit codes as a table in Markdown."""
    rows = ("| code | commands | when |", "| --- | --- | --- |")
    return "\n".join([*rows, *(f"| {e.number} | {e.commands} | {e.when} |" for e in EXIT_CODES)])
