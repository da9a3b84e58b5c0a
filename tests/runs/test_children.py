"""No process of a solver outlives its run: however it hides, and however femtune ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from tests.runs.fake import fake_solver

from femtune.executor import Threads
from femtune.runs import evaluate
from femtune.runs.process import RunInterruptedError, begun, end_all, end_marked, run_process, start_of

pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are found in /proc")

# a process that leaves the session of the solver, writes its number and stays
_HIDING = "import os, time; os.setsid(); open({pid!r}, 'w').write(str(os.getpid())); time.sleep(60)"
_FEMTUNE = """
from pathlib import Path
from tests.runs.fake import fake_solver, fail
from femtune.executor import Threads
from femtune.runs import evaluate
from dataclasses import replace
folder = Path({folder!r})
solver = replace(fake_solver(folder), command=({python!r}, "-c", {script!r}))
evaluate(solver, [{{"k1": 4.0, "k2": 9.0, "point": 1}}], Threads(1))
"""


def _waited(path: Path) -> int:
    for _ in range(500):
        if path.exists() and path.read_text().strip():
            return int(path.read_text())
        time.sleep(0.02)
    raise AssertionError(f"{path} was not written")


def test_a_process_in_a_session_of_its_own_ends_with_the_run(tmp_path: Path) -> None:
    pid = str(tmp_path / "pid")
    script = (
        f"import subprocess, sys, os, time; subprocess.Popen([sys.executable, '-c', {_HIDING.format(pid=pid)!r}])\n"
        f"while not (os.path.exists({pid!r}) and os.path.getsize({pid!r})): time.sleep(0.01)"
    )
    assert run_process((sys.executable, "-c", script), tmp_path, 30.0, {}, begun()) == 0
    assert start_of(int((tmp_path / "pid").read_text())) == ""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are found in /proc")
def test_a_process_that_takes_its_time_to_go_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kill, begin = os.kill, time.monotonic()
    marked = {**os.environ, "FEMTUNE_RUN": str(tmp_path.resolve())}
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], env=marked)

    def late(pid: int, number: int) -> None:
        # as on a busy machine
        if time.monotonic() - begin > 2.0:
            kill(pid, number)

    time.sleep(0.1)
    monkeypatch.setattr(os, "kill", late)
    assert end_marked(tmp_path)
    assert process.wait(10.0) == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.parametrize("hidden", [False, True])
def test_after_a_kill_the_next_start_ends_the_solver_before_it_removes_its_folder(tmp_path: Path, hidden: bool) -> None:
    pid = tmp_path / "pid"
    stay = _HIDING if hidden else _HIDING.replace("os.setsid(); ", "")
    program = _FEMTUNE.format(folder=str(tmp_path), python=sys.executable, script=stay.format(pid=str(pid)))
    if hidden:
        child = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {stay.format(pid=str(pid))!r}])"
        program = _FEMTUNE.format(folder=str(tmp_path), python=sys.executable, script=child)
    root = Path(__file__).parents[2]
    femtune = subprocess.Popen([sys.executable, "-c", program], cwd=root)
    solver = _waited(pid)
    (folder,) = (tmp_path / "runs").iterdir()
    evaluate(fake_solver(tmp_path), [], Threads(1))
    assert start_of(solver), "a run under way of a living program is left alone"
    assert folder.exists()
    femtune.send_signal(signal.SIGKILL)
    femtune.wait()
    assert start_of(solver)
    evaluate(fake_solver(tmp_path), [], Threads(1))
    assert start_of(solver) == ""
    assert not folder.exists()


def test_a_run_that_is_started_while_all_are_ended_is_ended_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    popen, begin = subprocess.Popen, time.monotonic()
    started: list[subprocess.Popen[bytes]] = []

    def interrupted(*words: Any, **options: Any) -> subprocess.Popen[bytes]:
        started.append(popen(*words, **options))
        # before anything is known of the process
        end_all()
        return started[0]

    monkeypatch.setattr(subprocess, "Popen", interrupted)
    with pytest.raises(RunInterruptedError):
        run_process((sys.executable, "-c", "import time; time.sleep(60)"), tmp_path, 60.0, {}, begun())
    assert started[0].poll() is not None
    assert time.monotonic() - begin < 30.0


def test_no_thread_starts_a_run_after_all_were_ended(tmp_path: Path) -> None:
    solver, point = fake_solver(tmp_path), {"k1": 4.0, "k2": 9.0, "point": 1}
    end_all()
    with ThreadPoolExecutor(1) as pool, pytest.raises(RunInterruptedError):
        pool.submit(solver.run, point).result()
    assert list((tmp_path / "runs").iterdir()) == []
    # other runs may begin
    assert evaluate(solver, [point], Threads(1)).started == 1


def test_a_number_that_belongs_to_another_process_by_now_is_not_ended(tmp_path: Path) -> None:
    from femtune.runs.process import end_left  # noqa: PLC0415

    other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], start_new_session=True)
    try:
        assert end_left(tmp_path, other.pid, "1")
        assert other.poll() is None
        assert end_left(tmp_path, os.getpid(), "")
    finally:
        other.kill()
        other.wait()
