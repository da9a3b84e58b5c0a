"""Progress: nothing for two seconds, then lines or a bar."""

from __future__ import annotations

import io
import time

import pytest
from rich.console import Console

from femtune.cli import display
from femtune.cli.display import Display
from femtune.study.progress import Progress, silent


class _Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def _lines(times: list[float], total: int | None = 9, quiet: bool = False) -> list[str]:
    """What a display without terminal prints for steps at the given times."""
    stream, clock = io.StringIO(), _Clock()
    with Display(quiet, Console(file=stream), clock) as progress:
        for i, now in enumerate(times):
            clock.now = now
            progress.step("modes of [red]", i, total)
    return stream.getvalue().splitlines()


def test_nothing_before_two_seconds() -> None:
    assert _lines([0.0, 1.0, 1.99]) == []


def test_lines_every_few_seconds_without_markup() -> None:
    assert _lines([0.0, 2.5, 3.0, 7.4, 7.6, 8.0]) == ["modes of [red] 1/9", "modes of [red] 4/9"]


def test_count_without_total() -> None:
    assert _lines([3.0], total=None) == ["modes of [red]"]


def test_quiet_shows_nothing() -> None:
    assert _lines([9.0, 20.0], quiet=True) == []


def test_text_cannot_steer_the_terminal() -> None:
    stream, clock = io.StringIO(), _Clock()
    with Display(False, Console(file=stream), clock) as progress:
        clock.now = 3.0
        progress.step("\x1b[2J", 0, None)
    assert "\x1b" not in stream.getvalue()


def _terminal(monkeypatch: pytest.MonkeyPatch, wait_s: float) -> str:
    monkeypatch.setattr(display, "QUIET_S", 0.05)
    stream = io.StringIO()
    with Display(False, Console(file=stream, force_terminal=True, width=80)) as progress:
        progress.step("modes of [BC]", 1, 2)
        time.sleep(wait_s)
    return stream.getvalue()


def test_bar_appears_by_itself_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "modes of [BC]" in _terminal(monkeypatch, 0.4)


def test_bar_does_not_appear_for_quick_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "modes" not in _terminal(monkeypatch, 0.0)


def test_both_are_what_the_library_wants() -> None:
    shown: list[Progress] = [silent, Display()]
    for progress in shown:
        progress.step("x", 0, None)
