"""Progress of the steps: the library reports it, and the caller may show it."""

from __future__ import annotations

import logging
from typing import Protocol


class Progress(Protocol):
    """Receives every step of a long analysis."""

    def step(self, text: str, done: int, total: int | None) -> None:
        """`text` says what is being done; `done` of `total` are done; `total` is None if it is not known."""
        ...


_LOGGER = logging.getLogger("femtune.progress")


def log_step(text: str, done: int, total: int | None) -> None:
    """A step as a record of the logger ``femtune.progress``, at level INFO."""
    count = f" {done}/{total}" if total else f" {done}" if done else ""
    _LOGGER.info("%s%s", text, count)


class _Silent:
    """Shows nothing; the steps are logged if logging is switched on."""

    def step(self, text: str, done: int, total: int | None) -> None:
        """A record of the log."""
        log_step(text, done, total)


silent: Progress = _Silent()
