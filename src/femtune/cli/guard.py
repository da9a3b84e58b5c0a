"""Handling of errors, Ctrl-C and internal errors on the command line: a message and an exit code, no traceback."""

from __future__ import annotations

import codecs
import errno
import json
import logging
import os
import platform
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

import click

from femtune import __version__
from femtune.cli.log import RESULTS
from femtune.errors import FemtuneError, printable
from femtune.journal.run_files import OWNER_FILE
from femtune.steps.exit_codes import BAD_INPUT, CUT_OFF, FAULT, HUNG_UP, INTERRUPTED, TERMINATED
from femtune.steps.step import coloured

CRASH_FILE = "femtune-crash.txt"
"""File with the traceback of an error in femtune itself."""


@dataclass(frozen=True)
class Running:
    """The command that is running: its run folder, if known, and the time of its start."""

    place: Path
    started: float = field(default_factory=time.time)

    def folder(self) -> Path | None:
        """The run folder, if it exists."""
        # False too for a name that no folder can have
        return self.place if os.path.isdir(self.place) else None

    def written(self) -> list[Path]:
        """Files in the run folder that are not older than the command, except the record of whose folder it is."""
        folder = self.folder()
        files = folder.iterdir() if folder else ()
        return sorted(f for f in files if f.name != OWNER_FILE and f.is_file() and self._is_new(f))

    def journaled(self) -> list[str]:
        """Contents of the journal in words, if the command has written into the run folder."""
        folder = self.folder()
        journal = folder / "journal" if folder is not None else None
        if journal is None or not os.path.isdir(journal):
            return []
        counts = []
        if self._is_new(journal) or self.written():
            counts.append(_counted(sum(name.endswith(".npz") for name in os.listdir(journal)), "solution", journal))
        runs = journal / "runs.sqlite"
        if runs.is_file() and self._is_new(runs):
            counts.append(_counted(_rows(runs), "external run", runs))
        return [text for text in counts if text]

    def _is_new(self, path: Path) -> bool:
        # file systems store times with a granularity of up to 2 s
        return path.stat().st_mtime >= self.started - 2.0


def _counted(count: int, what: str, place: Path) -> str:
    return f"{count} {what}{'s' if count > 1 else ''} in {place}" if count else ""


def _rows(path: Path) -> int:
    """Number of external runs in their journal; 0 if it cannot be read."""
    import sqlite3  # noqa: PLC0415  few interrupted commands have external runs

    try:
        with closing(sqlite3.connect(path, timeout=1.0)) as database:
            return int(database.execute("SELECT COUNT(*) FROM runs").fetchone()[0])
    except sqlite3.Error:
        return 0


_ENDING = tuple(s for s in (signal.SIGTERM, getattr(signal, "SIGHUP", None)) if s is not None)
"""Signals that ask a process to end: by a queue, and where its terminal was closed. Windows has no SIGHUP."""
_EXIT_CODES = {signal.SIGTERM: TERMINATED, getattr(signal, "SIGHUP", None): HUNG_UP}


class TerminatedError(KeyboardInterrupt):
    """The process was asked to end by a signal: it ends as after Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.signal = signal.Signals(number)


def _terminate(number: int, *_: object) -> NoReturn:
    # a second one must not interrupt the end of the solvers
    for other in _ENDING:
        signal.signal(other, signal.SIG_IGN)
    raise TerminatedError(number)


@contextmanager
def _ends_when_asked() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the command as Ctrl-C does; only the main thread may set a handler.

    A signal that is ignored stays so: under `nohup` a command outlives its terminal.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {s: signal.getsignal(s) for s in _ENDING}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, _terminate)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


_REPLACING = "femtune.replace"
"""Name of the treatment of characters that an encoding lacks."""
_PLAIN = {
    "≤": "<=", "≥": ">=", "→": "->", "←": "<-", "−": "-", "–": "-", "—": "-", "…": "...", "•": "*", "·": "*", "×": "x",
    "±": "+/-", "≈": "~", "√": "sqrt", "Σ": "Sum", "σ": "sigma", "χ": "chi", "δ": "delta", "ζ": "zeta", "λ": "lambda",
    "φ": "phi", "η": "eta", "ν": "nu", "ρ": "rho", "ω": "omega", "²": "^2", "³": "^3", "°": " deg", "µ": "u",
    "é": "e", "ö": "o", "ä": "a", "ü": "u", "’": "'", "“": '"', "”": '"', "─": "-", "━": "-", "│": "|",
}  # fmt: skip
"""What stands for characters that an encoding lacks."""


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(_PLAIN.get(c, "?") for c in error.object[error.start : error.end]), error.end


def _is_unicode(stream: TextIOWrapper) -> bool:
    return stream.encoding.lower().startswith("utf")


# without a handler Python would print them all the same
logging.getLogger("py.warnings").addHandler(logging.NullHandler())
codecs.register_error(_REPLACING, _replaced)
_ASCII = "femtune_ascii"
"""ASCII under another name: click takes a stream in ASCII for a mistake, and writes UTF-8 into it."""


def _ascii(name: str) -> codecs.CodecInfo | None:
    if name != _ASCII:
        return None
    own = codecs.lookup("ascii")
    return codecs.CodecInfo(
        own.encode,
        own.decode,
        own.streamreader,
        own.streamwriter,
        own.incrementalencoder,
        own.incrementaldecoder,
        _ASCII,
    )


codecs.register(_ascii)


HELP = "Help"
"""Heading of the commands that belong to no step."""


class GuardedGroup(click.Group):
    """A group of commands whose failures end as messages and exit codes."""

    def __init__(self, *words: Any, **options: Any) -> None:
        super().__init__(*words, **options)
        self.group_of: dict[str, str] = {}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands by groups, and in the order of the steps within a group."""
        return [name for names in self._groups().values() for name in names]

    def _groups(self) -> dict[str, list[str]]:
        groups: dict[str, list[str]] = {}
        for name in self.commands:
            groups.setdefault(self.group_of.get(name, HELP), []).append(name)
        return groups

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The commands under the headings of their groups, each with the first sentence of its help."""
        for heading, names in self._groups().items():
            with formatter.section(heading):
                formatter.write_dl([(name, (self.commands[name].help or "").partition("\n\n")[0]) for name in names])

    def main(self, *words: Any, **options: Any) -> Any:
        """Run the command line; characters that a console or a pipe lacks are replaced.

        Warnings of Python and of libraries are no messages for a user, and are not shown.
        """
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper) and not (
                stream.encoding.lower().startswith("utf") and stream is sys.stderr
            ):
                is_ascii = codecs.lookup(stream.encoding).name == "ascii"
                stream.reconfigure(encoding=_ASCII if is_ascii else None, errors=_REPLACING)
        logging.captureWarnings(True)
        try:
            return super().main(*words, **options)
        except SystemExit as end:
            # tables end with 1, which has another meaning
            if isinstance(end.__context__, BrokenPipeError):
                sys.exit(CUT_OFF)
            raise
        except OSError as fault:
            # of the help, or of a message: errors of commands end before
            if fault.errno not in _NO_SPACE:
                raise
            _say(coloured(_disk_full(fault)), err=True)
            _forget_output()
            sys.exit(BAD_INPUT)
        finally:
            logging.captureWarnings(False)

    def make_context(self, *words: Any, **options: Any) -> click.Context:
        """Read the words of the command line; the help may be read by a program that ends early."""
        try:
            return super().make_context(*words, **options)
        except BrokenPipeError:
            _forget_output()
            raise click.exceptions.Exit(CUT_OFF) from None

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        # known before the words of the command are parsed, which may fail
        ctx.meta[_JSON_KEY] = "--json" in ctx.args
        with _ends_when_asked(), _guarded(ctx):
            return super().invoke(ctx)


_JSON_KEY = "femtune.json"
"""Where the context of a command keeps whether JSON is asked for."""


def _as_json(ctx: click.Context, error: FemtuneError | str, exit_code: int) -> None:
    """A failure on standard output, if the command was asked for JSON; a sentence if it is no error of the input."""
    if not ctx.find_root().meta[_JSON_KEY]:
        return
    # help does without records
    from femtune.steps.problem import CommandFailure, failure_of  # noqa: PLC0415

    if isinstance(error, str):
        failure = CommandFailure(exit_code=exit_code, code="", message=printable(error))
    else:
        failure = failure_of(error, exit_code)
    _say(json.dumps({"error": failure.model_dump()}, indent=1))


def _say(text: str, *, err: bool = False) -> None:
    """Write a message, unless nobody can read it: its file is on a full disk, the terminal or the pipe was closed."""
    with suppress(OSError):
        click.echo(text, err=err)


def _forget_output() -> None:
    """What could not be written is not tried again when the process ends, which would change its exit code."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _guarded(ctx: click.Context) -> Iterator[None]:
    try:
        yield
        _log_end(0)
    except FemtuneError as error:
        _refused(ctx, error)
    except KeyboardInterrupt as asked:
        _interrupted(ctx, asked)
    except MemoryError as short:
        _refused(ctx, _out_of_memory(short))
    except click.exceptions.Exit as end:
        _log_end(end.exit_code)
        raise
    except click.ClickException as wrong:
        _as_json(ctx, wrong.format_message(), wrong.exit_code)
        raise
    except click.Abort:
        raise
    except Exception as fault:
        if isinstance(fault, OSError):
            _failed_by_system(ctx, fault)
        _crashed(ctx, fault)


def _log_end(code: int) -> None:
    RESULTS.info("ended with exit code %d", code)


def _end(ctx: click.Context, code: int) -> NoReturn:
    # the log is closed with the context
    _log_end(code)
    ctx.exit(code)


def _refused(ctx: click.Context, error: FemtuneError) -> NoReturn:
    RESULTS.error("%s", error)
    _say(coloured(error), err=True)
    _as_json(ctx, error, BAD_INPUT)
    _end(ctx, BAD_INPUT)


_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of the operating system: the disk is full, the quota is used up, the file is too large."""


def _disk_full(fault: OSError) -> FemtuneError:
    where = "a file" if fault.filename is None else str(fault.filename)
    return FemtuneError("run.disk-full", file=where, reason=fault.strerror)


def _failed_by_system(ctx: click.Context, fault: OSError) -> None:
    """End the command where the system, and not femtune, is the cause."""
    if isinstance(fault, BrokenPipeError):
        _forget_output()
        _end(ctx, CUT_OFF)
    if fault.errno in _NO_SPACE:
        _forget_output()
        _refused(ctx, _disk_full(fault))
    if isinstance(fault, PermissionError):
        _refused(ctx, _denied(fault))


def _denied(fault: PermissionError) -> FemtuneError:
    where = "a file" if fault.filename is None else str(fault.filename)
    return FemtuneError("run.denied", file=where, reason=fault.strerror)


def _out_of_memory(short: MemoryError) -> FemtuneError:
    """The requested memory, if the allocation reports it, and the free memory, if its reader was loaded before."""
    memory = sys.modules.get("femtune.model.linear.memory")
    free = memory.free_memory() if memory is not None else None
    values = {} if free is None else {"free_bytes": free}
    if not str(short):
        return FemtuneError("model.memory/exhausted", values=values)
    return FemtuneError("model.memory/exhausted-at", values=values, allocation=str(short).splitlines()[0])


def _interrupted(ctx: click.Context, asked: KeyboardInterrupt) -> NoReturn:
    """State what has been kept."""
    running = ctx.find_object(Running)
    files = ", ".join(str(file) for file in running.written()) if running else ""
    kept = f"kept: {files}" if files else "nothing was written"
    journaled = running.journaled() if running else []
    if journaled:
        kept = f"{f'kept: {files}, and' if files else 'kept:'} {' and '.join(journaled)}"
        kept += "; the same command continues from there"
    signalled = asked.signal if isinstance(asked, TerminatedError) else None
    told = f"stopped by {'Ctrl-C' if signalled is None else signalled.name}; {kept}"
    RESULTS.error(told)
    _say(printable(told), err=True)
    exit_code = INTERRUPTED if signalled is None else _EXIT_CODES[signalled]
    _as_json(ctx, told, exit_code)
    _end(ctx, exit_code)


def _crashed(ctx: click.Context, fault: Exception) -> NoReturn:
    """One line for the user, the traceback in a file."""
    name = _write_crash(ctx.find_object(Running), fault)
    kind = f"{type(fault).__name__}: {fault}".splitlines()[0]
    what = f"internal error of femtune, not caused by your input ({kind}); please report it and send {name}"
    RESULTS.error(what)
    _say(printable(what), err=True)
    _as_json(ctx, what, FAULT)
    _end(ctx, FAULT)


def _write_crash(running: Running | None, fault: Exception) -> str:
    """Path of the file with the traceback: in the run folder, else in the current folder, else in that of temporary
    files."""
    lines = [f"femtune {__version__}, Python {sys.version.split()[0]}, {platform.platform()}"]
    lines += [f"command: {' '.join(sys.argv)}", "", *traceback.format_exception(fault)]
    text = "\n".join(line.rstrip("\n") for line in lines)
    folder = running.folder() if running else None
    for place in (folder, Path.cwd(), Path(tempfile.gettempdir())):
        if place is not None and _wrote(place / CRASH_FILE, text):
            return str(place / CRASH_FILE)
    return "these lines:\n" + text


def _wrote(file: Path, text: str) -> bool:
    try:
        file.write_text(text + "\n", encoding="utf-8")
    except OSError:
        return False
    return True
