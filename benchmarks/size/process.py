"""A process within a limit of time and memory, and what its children took."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

_EVERY_SECONDS, _PATIENCE_SECONDS = 0.2, 10.0


@dataclass(frozen=True)
class Limits:
    """Where a run is ended."""

    seconds: float
    gib: float


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Parameters
    ----------
    code : its exit code
    over : the limit that it passed, or nothing
    children_mib : largest sum of its descendants' resident memory, by samples (0 where there is no /proc)
    """

    code: int
    over: str
    children_mib: float


def run_within(command: list[str], environment: dict[str, str], log: Path, limits: Limits) -> Ended:
    """Run a command; beyond a limit it is ended with its descendants."""
    start, most, over = time.monotonic(), 0.0, ""
    with log.open("w") as out:
        process = subprocess.Popen(command, env=environment, stdout=out, stderr=subprocess.STDOUT)
        while process.poll() is None:
            family = descendants(process.pid)
            below = sum(map(resident_mib, family))
            most = max(most, below)
            over = _over(time.monotonic() - start, (below + resident_mib(process.pid)) / 1024, limits)
            if over:
                _end(process, family)
                break
            time.sleep(_EVERY_SECONDS)
    return Ended(process.wait(), over, round(most, 1))


def _over(seconds: float, gib: float, limits: Limits) -> str:
    if seconds > limits.seconds:
        return f"> {limits.seconds:.0f} s"
    return f"> {limits.gib:g} GiB" if gib > limits.gib else ""


def descendants(pid: int) -> list[int]:
    """Processes that a process started, and those that they started."""
    out: list[int] = []
    for listed in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, _text(listed).split()):
            out += [child, *descendants(child)]
    return out


def resident_mib(pid: int) -> float:
    """Memory of one process; 0 where it has ended."""
    fields = _text(Path(f"/proc/{pid}/statm")).split()
    return int(fields[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20 if fields else 0.0


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:  # it has ended
        return ""


def _end(process: subprocess.Popen[bytes], family: list[int]) -> None:
    """The children first, so that none is left without a parent."""
    for pid in family:
        if pid in descendants(process.pid):
            os.kill(pid, signal.SIGTERM)
    process.terminate()
    try:
        process.wait(_PATIENCE_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
