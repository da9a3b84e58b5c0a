"""Progress on standard error: nothing for two seconds, then a bar on a terminal or a line now and then elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from femtune.errors import printable

QUIET_S = 2.0
"""What takes less than this shows nothing."""

BETWEEN_LINES_S = 5.0


class Display:
    """A `femtune.study.progress.Progress` that is a context manager; `quiet` shows nothing at all."""

    def __init__(
        self, quiet: bool = False, console: Console | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._console = console or Console(stderr=True)
        self._clock = clock
        self._quiet = quiet
        self._show: _Bar | _Lines | None = None

    def __enter__(self) -> Display:
        if not self._quiet:
            self._show = _Bar(self._console) if self._console.is_terminal else _Lines(self._console, self._clock)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._show is not None:
            self._show.close()

    def step(self, text: str, done: int, total: int | None) -> None:
        """Say what is being done."""
        if self._show is not None:
            self._show.step(printable(text), done, total)


class _Lines:
    """Plain lines, the first after two seconds."""

    def __init__(self, console: Console, clock: Callable[[], float]) -> None:
        self._console, self._clock = console, clock
        self._next = clock() + QUIET_S

    def step(self, text: str, done: int, total: int | None) -> None:
        if self._clock() >= self._next:
            count = f" {done}/{total}" if total else f" {done}" if done else ""
            self._console.print(f"{text}{count}", markup=False, highlight=False, soft_wrap=True)
            self._next = self._clock() + BETWEEN_LINES_S

    def close(self) -> None:
        """Nothing is left open."""


class _Bar:
    """A bar that a timer makes visible, so that it also appears while a step says nothing."""

    def __init__(self, console: Console) -> None:
        columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn())
        self._progress = Progress(*columns, TimeElapsedColumn(), console=console, transient=True)
        self._task = self._progress.add_task("", total=None)
        self._lock, self._closed = threading.Lock(), False
        self._timer = threading.Timer(QUIET_S, self._appear)
        self._timer.daemon = True
        self._timer.start()

    def _appear(self) -> None:
        with self._lock:
            if not self._closed:
                self._progress.start()

    def step(self, text: str, done: int, total: int | None) -> None:
        self._progress.update(self._task, description=text, completed=done, total=total)

    def close(self) -> None:
        self._timer.cancel()
        with self._lock:
            self._closed = True
            self._progress.stop()
