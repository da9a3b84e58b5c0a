"""Run a command with a limit of its time and of its output, and end it together with femtune."""

from __future__ import annotations

import math
import os
import shlex
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from femtune.errors import FemtuneError
from femtune.model.distributed.watch import PATIENCE_SECONDS

SECONDS = "FEMTUNE_SLEPC_SECONDS"
_DEFAULT_SECONDS = 6 * 3600.0
"""Time limit of one eigen-solution by default."""
MOST_OUTPUT_BYTES = 64 << 20
"""Size of the output of the processes above which they are stopped, since they would fill the disk."""
_POLL_SECONDS = 0.2
"""Time between two looks at the size of the output."""
_WATCH = Path(__file__).with_name("watch.py")


def seconds() -> float:
    """The longest time of one eigen-solution: of the environment, else six hours.

    Raises
    ------
    FemtuneError : ``slepc.launcher`` for what is not a positive number
    """
    text = os.environ.get(SECONDS, "").strip()
    with suppress(ValueError):
        limit = float(text) if text else _DEFAULT_SECONDS
        if limit > 0.0 and math.isfinite(limit):
            return limit
    raise FemtuneError("slepc.launcher/seconds", values={SECONDS: text[:80]}, seconds=SECONDS)


def run_to_end(command: list[str], environment: dict[str, str], said: Path) -> int:
    """The code that the command ends with; what it says goes to a file.

    Ctrl-C, an exception and the end of this process, by a kill too, end the command and its process group.

    Raises
    ------
    FemtuneError : ``slepc.timeout``, ``slepc.failed`` where it says too much, ``slepc.launcher``
    """
    limit = seconds()
    watched = [sys.executable, "-I", "-S", str(_WATCH), *command]
    with said.open("wb") as out:
        try:
            process = subprocess.Popen(
                watched, stdin=subprocess.PIPE, stdout=out, stderr=out, env=environment, start_new_session=True
            )
        except OSError as failed:
            raise FemtuneError("slepc.launcher/not-started", reason=failed) from failed
        try:
            return _wait(process, command, said, limit)
        finally:
            _end(process)


def _wait(process: subprocess.Popen[bytes], command: list[str], said: Path, limit: float) -> int:
    until = time.monotonic() + limit
    while time.monotonic() < until:
        with suppress(subprocess.TimeoutExpired):
            return process.wait(_POLL_SECONDS)
        if said.stat().st_size > MOST_OUTPUT_BYTES:
            raise said_too_much(command)
    raise timeout(command, limit)


def _end(process: subprocess.Popen[bytes]) -> None:
    assert process.stdin is not None
    process.stdin.close()
    try:
        process.wait(2 * PATIENCE_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def timeout(command: list[str], limit: float) -> FemtuneError:
    """The processes did not end in their time."""
    return FemtuneError("slepc.timeout", values={"command": shlex.join(command)}, limit=limit, seconds=SECONDS)


def said_too_much(command: list[str]) -> FemtuneError:
    """What the processes write would fill the disk."""
    return FemtuneError(
        "slepc.failed/too-much-text", values={"command": shlex.join(command)}, mib=MOST_OUTPUT_BYTES >> 20
    )
