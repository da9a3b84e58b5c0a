"""Progress: nothing for two seconds, then lines or a bar."""

from __future__ import annotations

import io
import sys
import time

import pytest

from femtune.cli import display
from femtune.cli.display import Display
from femtune.cli.pace import Pace
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
    lines = _lines(capsys, [0.0, 2.5, 3.0, 7.4, 7.6, 8.0])
    assert lines == ["modes of [red] 1/9, about 20 s left", "modes of [red] 4/9, about 10 s left"]


def test_the_remaining_time_is_that_of_the_last_parts() -> None:
    pace = Pace()
    recalled = [pace.left(0.01 * i, "starts", i, 100) for i in range(41)]
    solved = [pace.left(60.0 * (i - 40), "starts", i, 100) for i in range(41, 62)]
    assert set(recalled) == {""}
    assert solved[-1] == "about 39 min left"


@pytest.mark.parametrize("total", [None, 0])
def test_a_step_without_a_number_of_parts_has_no_remaining_time(total: int | None) -> None:
    pace = Pace()
    assert [pace.left(10.0 * i, "solving", i, total) for i in range(4)] == [""] * 4


def test_iterations_whose_text_changes_have_no_remaining_time() -> None:
    """Their total is a limit, not what is to be done."""
    pace = Pace()
    assert {pace.left(10.0 * i, f"update: weighted mean error {5 - i} %", i, 30) for i in range(4)} == {""}


def test_a_step_that_begins_again_has_the_pace_of_its_own_parts() -> None:
    pace = Pace()
    told = [pace.left(now, "runs", done, 4) for now, done in [(0.0, 0), (30.0, 1), (100.0, 0), (110.0, 1)]]
    assert told == ["", "about 1 min 30 s left", "", "about 30 s left"]


def test_no_time_is_left_at_the_end() -> None:
    pace = Pace()
    assert [pace.left(10.0 * i, "runs", i, 2) for i in range(3)][-1] == ""


def test_reports_without_progress_count_down() -> None:
    pace = Pace()
    told = [pace.left(now, "runs", done, 3) for now, done in [(0.0, 0), (20.0, 1), (35.0, 1), (300.0, 1)]]
    assert told == ["", "about 40 s left", "about 25 s left", "about 1 s left"]


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
