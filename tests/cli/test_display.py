"""Progress: nothing for two seconds, then lines or a bar."""

from __future__ import annotations

import io
import sys
import time

import pytest

from femtune.cli import display
from femtune.cli.display import Display
from femtune.study.progress import Progress, silent


class _Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def _lines(
    printed: pytest.CaptureFixture[str], times: list[float], total: int | None = 9, text: str = "modes of [red]"
) -> list[str]:
    """What a display without terminal prints for steps at the given times."""
    clock = _Clock()
    with Display(clock=clock) as progress:
        for i, now in enumerate(times):
            clock.now = now
            progress.step(text, i, total)
    return printed.readouterr().err.splitlines()


def test_nothing_before_two_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    assert _lines(capsys, [0.0, 1.0, 1.99]) == []


def test_lines_every_few_seconds_without_markup(capsys: pytest.CaptureFixture[str]) -> None:
    assert _lines(capsys, [0.0, 2.5, 3.0, 7.4, 7.6, 8.0]) == ["modes of [red] 1/9", "modes of [red] 4/9"]


def test_count_without_total(capsys: pytest.CaptureFixture[str]) -> None:
    assert _lines(capsys, [3.0], total=None) == ["modes of [red]"]


def test_quiet_shows_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    clock = _Clock()
    with Display(True, clock) as progress:
        clock.now = 9.0
        progress.step("modes", 1, 2)
    assert capsys.readouterr().err == ""


def test_text_cannot_steer_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    assert _lines(capsys, [3.0], None, "\x1b[2J") == ["\\x1b[2J"]


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def _terminal(monkeypatch: pytest.MonkeyPatch, wait_s: float) -> str:
    monkeypatch.setattr(display, "QUIET_S", 0.05)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr("sys.stderr", _Terminal())
    with Display() as progress:
        progress.step("modes of [BC]", 1, 2)
        time.sleep(wait_s)
    written = sys.stderr
    assert isinstance(written, _Terminal)
    return written.getvalue()


@pytest.mark.slow
def test_bar_appears_by_itself_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "modes of [BC]" in _terminal(monkeypatch, 0.6)


def test_bar_does_not_appear_for_quick_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "modes" not in _terminal(monkeypatch, 0.0)


def test_both_are_what_the_library_wants(capsys: pytest.CaptureFixture[str]) -> None:
    """Outside of a display, as in Python, neither writes anything."""
    shown: list[Progress] = [silent, Display()]
    for progress in shown:
        progress.step("x", 0, None)
    assert capsys.readouterr() == ("", "")
