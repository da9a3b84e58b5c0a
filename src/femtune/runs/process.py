"""One process of a solver: started without a shell, in a folder of its own, ended with its children when it is late."""

from __future__ import annotations

import atexit
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from femtune.errors import FemtuneError, Where

LOG = "femtune_solver.log"
"""What the solver prints, in the folder of the run."""
MARK = "FEMTUNE_RUN"
"""Variable of the environment of a solver, with the folder of its run: what it starts has it too, wherever it goes."""
_PROC = Path("/proc")
"""What Linux tells of processes; absent on other systems."""
_LONGEST_S = 10.0
"""Time in s for which processes of a run are looked for and ended: on a busy machine they take a while to go."""
_PAUSE_S = 0.01
"""Time in s that the system gets to remove processes that were ended; one may have started others meanwhile."""
_RUNNING: dict[subprocess.Popen[bytes], Path] = {}
_STOPS: list[threading.Event] = [threading.Event()]
"""The event of the runs that go on; it is set when they are interrupted, and `begin_runs` replaces it."""
_LOCK = threading.Lock()


class RunInterruptedError(Exception):
    """The runs were interrupted; this one is not tried again."""


def begin_runs() -> None:
    """Let runs begin again after others were interrupted.

    Until then none begins: a thread that was about to start a run when all were ended must not start it afterwards.
    """
    with _LOCK:
        if _STOPS[0].is_set():
            _STOPS[0] = threading.Event()


def begun() -> threading.Event:
    """What is set when the runs that begin now are interrupted; it is set already for a thread of interrupted runs."""
    if threading.current_thread() is threading.main_thread():
        begin_runs()
    return _STOPS[0]


def pause(seconds: float, stop: threading.Event) -> None:
    """Wait, unless the runs are interrupted (RunInterruptedError)."""
    if stop.wait(seconds):
        raise RunInterruptedError


def run_process(
    command: Sequence[str],
    folder: Path,
    timeout_s: float,
    environment: Mapping[str, str],
    stop: threading.Event,
    started: Callable[[int], None] = lambda pid: None,
) -> int | None:
    """The exit code of a command, None where it was ended because it took longer than `timeout_s`.

    Parameters
    ----------
    started : is called with the number of the process

    Raises
    ------
    FemtuneError : ``external.not-started``
    RunInterruptedError : `end_all` was called since `stop` was the event of the runs
    """
    pause(0.0, stop)
    with (folder / LOG).open("wb") as log:
        try:
            # a group of its own, so that what the solver starts ends with it
            process = subprocess.Popen(
                list(command), cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                env={**os.environ, **environment, MARK: str(folder.resolve())}, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise FemtuneError(
                "external.not-started", where=Where(str(folder)), program=command[0], reason=error.strerror
            ) from error
    with _LOCK:
        _RUNNING[process] = folder.resolve()
    try:
        # they may have been ended while this one was started
        pause(0.0, stop)
        started(process.pid)
        code = process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        code = None
    finally:
        _end(process, folder)
        with _LOCK:
            del _RUNNING[process]
    pause(0.0, stop)
    return code


def _end(process: subprocess.Popen[bytes], folder: Path) -> None:
    """End the process and what it has started, and wait for it."""
    if hasattr(os, "killpg"):
        _signal(os.killpg, process.pid)
    else:
        process.kill()
    end_marked(folder)
    process.wait()


def _signal(send: Callable[[int, int], None], pid: int) -> None:
    try:
        send(pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        return


def end_all() -> None:
    """End all solvers that this process has started: the run is interrupted."""
    with _LOCK:
        _STOPS[0].set()
        running = list(_RUNNING.items())
    for process, folder in running:
        _end(process, folder)


# however the program ends, short of a signal that cannot be handled
atexit.register(end_all)


def end_left(folder: Path, pid: int, since: str) -> bool:
    """End what an interrupted run has left in its folder; False if something of it is still there.

    Parameters
    ----------
    pid, since : of the solver, when it was started: the number may belong to another process by now
    """
    if pid > 0 and since and start_of(pid) == since:
        # the solver leads its group
        _signal(os.killpg, pid)
    return end_marked(folder) and not (pid > 0 and since and start_of(pid) == since)


def end_marked(folder: Path) -> bool:
    """End processes that a run has started, also those in sessions of their own; False if some are still there."""
    marked = os.fsencode(f"{MARK}={folder.resolve()}")
    end, pause_s = time.monotonic() + _LONGEST_S, _PAUSE_S
    while processes := list(_with(marked)):
        if time.monotonic() > end:
            return False
        for pid in processes:
            _signal(os.kill, pid)
        time.sleep(pause_s)
        pause_s = min(2.0 * pause_s, 0.2)
    return True


def _with(variable: bytes) -> Iterator[int]:
    """Processes of this user with a variable in their environment; none where the system does not tell."""
    try:
        names = [name for name in os.listdir(_PROC) if name.isdecimal() and int(name) != os.getpid()]
    except OSError:
        return
    for name in names:
        try:
            if variable in (_PROC / name / "environ").read_bytes().split(b"\0"):
                yield int(name)
        except OSError:
            continue


def start_of(pid: int) -> str:
    """Start of a living process in ticks since the system was started; "" for none, or where that cannot be told."""
    try:
        state, *rest = (_PROC / str(pid) / "stat").read_bytes().rpartition(b")")[2].split()
        return "" if state in (b"Z", b"X") else rest[18].decode()
    except (OSError, ValueError, IndexError):
        return ""


def is_alive(pid: str) -> bool:
    """Whether a process of this machine may still be there; always True where that cannot be told."""
    if not pid.isdecimal() or sys.platform == "win32":
        return sys.platform == "win32"
    try:
        os.kill(int(pid), 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
