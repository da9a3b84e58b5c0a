"""How the steps say where they are; the library says it, and whoever calls shows it or not."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Receives every step of a long analysis."""

    def step(self, text: str, done: int, total: int | None) -> None:
        """`text` says what is being done; `done` of `total` are done, `total` is None where nobody knows."""
        ...


class _Silent:
    """Shows nothing."""

    def step(self, text: str, done: int, total: int | None) -> None:
        """Nothing."""


silent: Progress = _Silent()
