"""Executors: the same results in the same order, and clear words for whatever happens to a run."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.executor.runs import Dies, Solve, breaks, late_first, prints, refuses, waits
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError, Notice
from femtune.executor import Executor, Processes, Serial, finish
from femtune.executor.worker import packed

_ROOT = Path(__file__).resolve().parents[2]
EXECUTORS = [Serial(), Processes(2)]
both = pytest.mark.parametrize("executor", EXECUTORS, ids=["serial", "processes"])


@pytest.mark.slow
def test_processes_are_serial_to_the_last_bit() -> None:
    # one thread here too: Solve is small enough for that
    assert Processes(3).run(Solve(8), range(40)) == Serial().run(Solve(8), range(40))


@both
@pytest.mark.slow
def test_results_are_in_the_order_of_the_tasks(executor: Executor) -> None:
    ended = []
    assert executor.run(late_first, range(4), finished=lambda i, r: ended.append((i, r))) == [0, 1, 4, 9]
    assert sorted(ended) == [(0, 0), (1, 1), (2, 4), (3, 9)]
    if isinstance(executor, Processes):
        assert ended[-1] == (0, 0)


@both
def test_no_task(executor: Executor) -> None:
    assert executor.run(late_first, []) == []


@both
@pytest.mark.slow
def test_an_error_names_the_run(executor: Executor) -> None:
    with pytest.raises(FemtuneError) as error:
        executor.run(refuses, range(8), name="start")
    assert error.value.code == "study.no-test"
    assert error.value.values == {"start": 4, "task": 3}


@both
def test_another_exception_is_told_with_its_run(executor: Executor) -> None:
    with pytest.raises(FemtuneError, match=r"start 3 .*ZeroDivisionError") as error:
        executor.run(breaks, [5, 6, 2], name="start")
    if isinstance(executor, Serial):
        check_shown("executor.failed", error.value)
    assert error.value.code == "executor.failed"


@pytest.mark.slow
def test_a_worker_that_died_is_told_and_its_run_repeated(tmp_path: Path) -> None:
    told: list[Notice] = []
    assert Processes(2).run(Dies(tmp_path), range(4), remark=told.append) == [0, 10, 20, 30]
    (notice,) = told
    check_shown("executor.worker-replaced", notice)


def test_a_run_that_kills_every_worker(tmp_path: Path) -> None:
    kept = {}
    with pytest.raises(FemtuneError) as error:
        Processes(1).run(Dies(tmp_path, True), [0, 1, 2], finished=kept.__setitem__)
    check_shown("executor.worker-died", error.value)
    assert kept[0] == 0
    assert 1 not in kept


class _Unloadable:
    """Its copy in another process cannot be made."""

    def __reduce__(self) -> tuple[object, ...]:
        return float, ("no number",)

    def __call__(self, task: int) -> int:
        return task


def test_work_that_other_processes_cannot_load() -> None:
    with pytest.raises(FemtuneError) as error:
        Processes(1).run(_Unloadable(), [1])
    check_shown("executor.not-sent", error.value)
    with pytest.raises(FemtuneError) as error:
        Processes(1).run(lambda x: x, [1])
    assert error.value.code == "executor.not-sent"


def test_work_of_the_main_program_is_refused_before_a_worker_is_started() -> None:
    class Own:
        """As it would be defined in a script."""

        __module__ = "__main__"

    for sent in (Own, Own(), [Own()]):
        with pytest.raises(FemtuneError, match="Own is defined in the script") as error:
            packed(sent)
        assert error.value.code == "executor.not-sent"
    assert pickle.loads(packed(late_first)) is late_first


def test_prints_do_not_spoil_answers_and_a_worker_has_one_thread() -> None:
    assert Processes(1).run(prints, [1, 2]) == ["1", "1"]


def test_known_runs_are_not_made_again() -> None:
    made = {}
    assert finish(Serial(), late_first, range(4), {0: 7, 2: 8}, finished=made.__setitem__) == [7, 1, 8, 9]
    assert made == {1: 1, 3: 9}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_outlives_its_program(tmp_path: Path, how: signal.Signals) -> None:
    # a job in the background ignores SIGINT and so would its children
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        f"from tests.executor.runs import interrupted; interrupted({str(tmp_path)!r})"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=_ROOT, stderr=subprocess.PIPE) as program:
        try:
            numbers = _wait_for(lambda: [int(p.read_text() or 0) for p in tmp_path.glob("*.pid")], 2)
            program.send_signal(how)
            _, said = program.communicate(timeout=_PATIENCE_S)
        finally:
            # what did not happen must not be left behind for other tests
            program.kill()
    assert program.returncode == (130 if how == signal.SIGINT else -signal.SIGKILL)
    assert b"Traceback" not in said
    _wait_for(lambda: [n for n in numbers if not _lives(n)], 2)


_PATIENCE_S = 300.0
"""How long is waited for what happens in a second on a quiet machine; the runs themselves last twice as long."""


def _wait_for(found: object, count: int) -> list[int]:
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        some = [n for n in found() if n]  # type: ignore[operator]
        if len(some) == count:
            return some
        time.sleep(0.05)
    raise AssertionError(f"it did not happen in {_PATIENCE_S:g} s")


def _lives(number: int) -> bool:
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return False
    # a process that has ended and that nobody waited for is a zombie
    state = Path(f"/proc/{number}/stat")
    return not (state.exists() and state.read_text().rpartition(")")[2].split()[0] == "Z")


def test_a_failing_start_of_a_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(12, "Cannot allocate memory")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    with pytest.raises(FemtuneError) as error:
        Processes(2).run(waits, [1, 2])
    check_shown("executor.no-worker", error.value)
