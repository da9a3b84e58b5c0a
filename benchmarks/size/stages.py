"""Seconds, processor seconds and peak memory of each stage of one process."""

from __future__ import annotations

import gc
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_OWN = Path("/proc/self")


@dataclass
class Stages:
    """What was measured so far, in order: name to seconds, cpu_seconds and peak_mib.

    The peak is of the stage itself where the kernel lets its mark be reset (Linux), else of the process so far.
    """

    measured: dict[str, dict[str, float]] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure what is done inside, and say it at once in the log of the run."""
        gc.collect()
        _reset_peak()
        start, cpu = time.perf_counter(), _cpu_seconds()
        yield
        seconds = time.perf_counter() - start
        self.measured[name] = {
            "seconds": round(seconds, 4),
            "cpu_seconds": round(_cpu_seconds() - cpu, 3),
            "peak_mib": round(peak_mib(), 1),
        }
        print(name, self.measured[name], flush=True)

    def into(self, name: str, **numbers: Any) -> None:
        """Further numbers of a stage."""
        self.measured[name] |= numbers


def peak_mib() -> float:
    """Largest resident memory of this process since the mark was reset."""
    status = _OWN / "status"
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def _reset_peak() -> None:
    try:
        (_OWN / "clear_refs").write_text("5")
    except OSError:  # not Linux, or not allowed: the peak is that of the process so far
        return


def _cpu_seconds() -> float:
    """Of this process and its children that have ended."""
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(used.ru_utime + used.ru_stime for used in map(resource.getrusage, who))
