"""One process of a solver: started without a shell, in a folder of its own, ended with its children when it is late."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

from femtune.errors import FemtuneError, Where

LOG = "femtune_solver.log"
"""What the solver prints, in the folder of the run."""
_RUNNING: set[subprocess.Popen[bytes]] = set()
_STOPS: list[threading.Event] = [threading.Event()]
"""The last event is that of the runs that go on; it is set when they are interrupted."""
_LOCK = threading.Lock()


class RunInterruptedError(Exception):
    """The runs were interrupted; this one is not tried again."""


def begun() -> threading.Event:
    """What is set when the runs that begin now are interrupted."""
    return _STOPS[-1]


def pause(seconds: float, stop: threading.Event) -> None:
    """Wait, unless the runs are interrupted (RunInterruptedError)."""
    if stop.wait(seconds):
        raise RunInterruptedError


def run_process(
    command: Sequence[str], folder: Path, timeout_s: float, environment: Mapping[str, str], stop: threading.Event
) -> int | None:
    """The exit code of a command, None where it was ended because it took longer than `timeout_s`.

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
                env={**os.environ, **environment}, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise FemtuneError(
                "external.not-started", where=Where(str(folder)), program=command[0], reason=error.strerror
            ) from error
    with _LOCK:
        _RUNNING.add(process)
    try:
        code = process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        code = None
    finally:
        _end(process)
        with _LOCK:
            _RUNNING.discard(process)
    pause(0.0, stop)
    return code


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the process and what it has started, and wait for it."""
    try:
        if hasattr(os, "killpg"):
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    except (ProcessLookupError, PermissionError):
        pass
    process.wait()


def end_all() -> None:
    """End all solvers that this process has started: the run is interrupted."""
    with _LOCK:
        _STOPS[-1].set()
        _STOPS.append(threading.Event())
        del _STOPS[:-1]
        running = list(_RUNNING)
    for process in running:
        _end(process)


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
