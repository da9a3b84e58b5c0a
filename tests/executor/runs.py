"""Runs for the tests of executors; worker processes import them."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.errors import FemtuneError
from femtune.executor import Processes


@dataclass(frozen=True)
class Solve:
    """A run with linear algebra that rounds: its last bits show the order of operations."""

    n: int = 60

    def __call__(self, seed: int) -> float:
        a = np.random.default_rng(seed).standard_normal((self.n, self.n))
        return float(np.linalg.solve(a @ a.T + np.eye(self.n), a).sum())


def late_first(task: int) -> int:
    """The first runs end last."""
    time.sleep(0.2 if task == 0 else 0.0)
    return task * task


def refuses(task: int) -> int:
    """An error of femtune in the third run."""
    if task == 3:
        raise FemtuneError("study.no-test", purpose="this test", values={"task": task})
    return task


def breaks(task: int) -> float:
    """An exception of another kind."""
    return 1.0 / (task - 2)


@dataclass(frozen=True)
class Dies:
    """The worker dies the first time, or every time, that it meets a task."""

    folder: Path
    always: bool = False

    def __call__(self, task: int) -> int:
        mark = self.folder / "died"
        if task == 1 and (self.always or not mark.exists()):
            mark.touch()
            os._exit(7)
        return 10 * task


def prints(task: int) -> str:
    """What a run prints must not spoil its answer."""
    print("something", flush=True)
    os.write(1, b"more")
    return os.environ["OMP_NUM_THREADS"]


def waits(task: int) -> int:
    """A long run."""
    time.sleep(60.0)
    return task


def interrupted(folder: str) -> None:
    """A program that is interrupted while its workers run; they leave their numbers in a folder."""
    try:
        Processes(2).run(Leaves(Path(folder)), [0, 1])
    except KeyboardInterrupt:
        sys.exit(130)


@dataclass(frozen=True)
class Leaves:
    """Leaves its process number and waits."""

    folder: Path

    def __call__(self, task: int) -> int:
        (self.folder / f"{task}.pid").write_text(str(os.getpid()))
        time.sleep(600.0)
        return task
