"""Progress on standard error: nothing for two seconds, then a bar on a terminal or a line now and then elsewhere.

Both tell the remaining time of a step that counts its parts.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

import click

from femtune.cli.pace import Pace
from femtune.errors import printable
from femtune.study.progress import log_step

if TYPE_CHECKING:
    from rich.progress import Progress

QUIET_S = 2.0
"""Time in s before progress is shown; shorter steps show none."""
BETWEEN_LINES_S = 5.0
"""Time in s between two lines of progress where the output is no terminal: log files stay short."""


class Display:
    """A `femtune.study.progress.Progress` that is a context manager; `quiet` shows nothing at all."""

    def __init__(self, quiet: bool = False, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._quiet = quiet
        self._show: _Bar | _Lines | None = None
        self._logged, self._next = "", 0.0

    def __enter__(self) -> Display:
        if not self._quiet:
            self._show = _Bar(self._clock) if sys.stderr.isatty() else _Lines(self._clock)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._show is not None:
            self._show.close()

    def step(self, text: str, done: int, total: int | None) -> None:
        """Say what is being done."""
        self._log(text, done, total)
        if self._show is not None:
            self._show.step(printable(text), done, total)

    def _log(self, text: str, done: int, total: int | None) -> None:
        """A line for every new step, and for a step that counts also a line every few seconds and one at its end."""
        now = self._clock()
        if text != self._logged or done == total or now >= self._next:
            log_step(text, done, total)
            self._logged, self._next = text, now + BETWEEN_LINES_S


class _Lines:
    """Plain lines, the first after two seconds."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._next, self._pace = clock() + QUIET_S, Pace()

    def step(self, text: str, done: int, total: int | None) -> None:
        left = self._pace.left(self._clock(), text, done, total)
        if self._clock() >= self._next:
            count = f" {done}/{total}" if total else f" {done}" if done else ""
            click.echo(f"{text}{count}{left and ', '}{left}", err=True)
            self._next = self._clock() + BETWEEN_LINES_S

    def close(self) -> None:
        """Nothing to close."""


class _Bar:
    """A bar that a timer shows, so that it also appears while a step reports nothing.

    The timer imports rich: a command of less than two seconds does not need it.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock, self._pace = clock, Pace()
        self._said: tuple[str, int, int | None] = ("", 0, None)
        self._left = ""
        self._bar: Progress | None = None
        self._lock, self._closed = threading.Lock(), False
        self._timer = threading.Timer(QUIET_S, self._appear)
        self._timer.daemon = True
        self._timer.start()

    def _appear(self) -> None:
        bar = _new_bar()
        with self._lock:
            if self._closed:
                return
            self._bar = bar
            self._tell(bar)
            bar.start()

    def step(self, text: str, done: int, total: int | None) -> None:
        with self._lock:
            self._said, self._left = (text, done, total), self._pace.left(self._clock(), text, done, total)
            if self._bar is not None:
                self._tell(self._bar)

    def _tell(self, bar: Progress) -> None:
        text, done, total = self._said
        bar.update(bar.task_ids[0], description=text, completed=done, total=total, left=self._left)

    def close(self) -> None:
        self._timer.cancel()
        with self._lock:
            self._closed = True
            if self._bar is not None:
                self._bar.stop()


def _new_bar() -> Progress:
    """A bar of one task on standard error."""
    from rich import progress  # noqa: PLC0415
    from rich.console import Console  # noqa: PLC0415

    columns = (
        progress.SpinnerColumn(),
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        progress.TextColumn("{task.fields[left]}", markup=False),
    )
    bar = progress.Progress(*columns, console=Console(stderr=True), transient=True)
    bar.add_task("", total=None, left="")
    return bar
