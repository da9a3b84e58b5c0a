"""The log of a command: every step, warning and error with its time, in a file or on standard error.

The lines are records of the loggers ``femtune.progress`` and ``femtune.results`` of Python's `logging`, which also a
program that uses the library can direct as it likes.
"""

from __future__ import annotations

import logging
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from femtune import __version__
from femtune.errors import FemtuneError, Notice, printable

PROGRESS = logging.getLogger("femtune.progress")
"""Logger of the steps and their progress."""
RESULTS = logging.getLogger("femtune.results")
"""Logger of results, warnings and errors of a command."""
_ALL = logging.getLogger("femtune")
# without a handler Python would print warnings once more
_ALL.addHandler(logging.NullHandler())
_FORMAT = "%(asctime)s %(levelname)-7s %(message)s"
_DATED_LINE = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ ")
"""Beginning of a line of the log, by which an existing log is recognised."""
_VERBOSE = "femtune.verbose"


class _Utc(logging.Formatter):
    """Times of ISO 8601 in UTC, so that logs of several machines can be compared."""

    converter = staticmethod(time.gmtime)

    def __init__(self) -> None:
        super().__init__(_FORMAT, "%Y-%m-%dT%H:%M:%SZ")

    def format(self, record: logging.LogRecord) -> str:
        """One line for each line of the message, without control characters."""
        return printable(super().format(record)).replace("\n", "\n    ")


@contextmanager
def _receiving(logger: logging.Logger, handler: logging.Handler) -> Iterator[None]:
    handler.setFormatter(_Utc())
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)
        handler.close()


def log_to(context: click.Context, option: click.Parameter, path: Path | None) -> None:
    """Append the log of this command to a file (error ``run.unwritable``)."""
    if path is None:
        return
    try:
        if os.path.lexists(path) and not _is_log(path):
            raise FemtuneError("run.unwritable/no-log", values={"file": path})
        handler = logging.FileHandler(path, encoding="utf-8")
    except OSError as error:
        raise FemtuneError("run.unwritable/log", values={"file": path}, reason=error.strerror) from None
    # the command as a whole: its errors are logged after the context of the subcommand has ended
    context.find_root().with_resource(_receiving(_ALL, handler))
    RESULTS.info("femtune %s: %s", __version__, " ".join(sys.argv[1:]))


def _is_log(path: Path) -> bool:
    """Whether an existing file is an earlier log, to which lines may be added: neither a link nor an input file."""
    if path.is_symlink() or not (path.is_file() or path.is_dir()):
        return False
    with path.open("rb") as stream:
        begin = stream.read(30)
    return not begin or _DATED_LINE.match(begin) is not None


def be_verbose(context: click.Context, option: click.Parameter, given: bool) -> None:
    """Print every step as a line on standard error, instead of the bar."""
    if given:
        context.find_root().meta[_VERBOSE] = True
        context.find_root().with_resource(_receiving(PROGRESS, logging.StreamHandler(sys.stderr)))


def is_verbose(context: click.Context) -> bool:
    """True if the steps are already shown as lines."""
    return bool(context.find_root().meta.get(_VERBOSE))


def log_results(result: Any) -> None:
    """Remarks and alerts of a result."""
    for remark in getattr(result, "remarks", ()):
        RESULTS.warning(str(remark))
    for alert in alerts_of(result):
        RESULTS.log(logging.INFO if alert.level == "info" else logging.WARNING, str(alert))


def alerts_of(result: Any) -> list[Notice]:
    """Every alert of a result: of the run, or of each record, each once."""
    of_run = getattr(getattr(result, "results", None), "alerts", None)
    records: Sequence[Any] = getattr(result, "records", None) or (getattr(result, "record", None),)
    alerts: list[Any] = [a for r in records for a in getattr(r, "alerts", ())] if of_run is None else list(of_run)
    return list(dict.fromkeys(Notice(a.code, a.sentence, level=a.level) for a in alerts))
