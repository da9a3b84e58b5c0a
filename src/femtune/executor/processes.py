"""Runs in processes of this machine, each with one thread."""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

from femtune.errors import FemtuneError, Notice
from femtune.executor.interface import failed, nothing, of_run, usable_cores
from femtune.executor.worker import packed, read, write

T = TypeVar("T")
R = TypeVar("R")
Answer = tuple[str, Any]

_THREADS = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)  # fmt: skip
_MOST_DEATHS = 2
"""Deaths of workers on the same run after which the run is to blame."""
_POLL_INTERVAL_S = 0.2
"""Time in s between looks for workers that died; users do not notice it, and it costs nothing."""


@dataclass(frozen=True)
class Processes:
    """Worker processes that each make one run at a time, with one thread.

    The results are those of `Serial` to the last bit where that uses one thread, too. A worker that dies, for lack of
    memory say, is replaced and its run repeated once.

    Parameters
    ----------
    workers : how many; one a core that this process may use where it is zero
    """

    workers: int = 0

    @property
    def words(self) -> str:
        """Name in results and reports."""
        number = self.workers or usable_cores()
        return f"{number} worker {'process' if number == 1 else 'processes'} of this machine"

    def run(
        self,
        work: Callable[[T], R],
        tasks: Sequence[T],
        *,
        name: str = "run",
        finished: Callable[[int, R], None] = nothing,
        remark: Callable[[Notice], None] = nothing,
    ) -> list[R]:
        """See `Executor`; errors ``executor.not-sent``, ``executor.worker-died``, ``executor.no-worker`` too."""
        if not len(tasks):
            return []
        pool = _Pool(packed(work), [packed(task) for task in tasks])
        try:
            pool.start(min(self.workers or usable_cores(), len(tasks)))
            return _gather(pool, len(tasks), name, finished, remark)
        finally:
            pool.stop()


def _gather(
    pool: _Pool, count: int, name: str, finished: Callable[[int, Any], None], remark: Callable[[Notice], None]
) -> list[Any]:
    results: dict[int, Any] = {}
    deaths: Counter[int] = Counter()
    while len(results) < count:
        at, (kind, value) = pool.next_answer()
        if kind == "done":
            results[at] = value
            finished(at, value)
        elif kind == "died":
            deaths[at] += 1
            if deaths[at] == _MOST_DEATHS:
                raise FemtuneError("executor.worker-died", run=f"{name} {at + 1}", status=value)
            remark(Notice("executor.worker-replaced", run=f"{name} {at + 1}", status=value))
            pool.put_back(at)
        else:
            raise error_of(kind, value, name, at)
    return [results[i] for i in range(count)]


def error_of(kind: str, value: Any, name: str, at: int) -> FemtuneError:
    """The error that an answer stands for, other than that of a run that is done."""
    if kind == "killed":
        return FemtuneError("executor.worker-died/cluster", run=f"{name} {at + 1}")
    if kind == "not-made":
        return FemtuneError("executor.not-sent/cluster", run=f"{name} {at + 1}", reason=value)
    if kind == "error":
        return of_run(value, name, at)
    if kind == "not-loaded":
        return FemtuneError("executor.not-sent", reason=value)
    return FemtuneError("executor.no-worker", reason=value) if kind == "no-worker" else failed(name, at, value)


@dataclass(eq=False)
class _Pool:
    """Threads that each feed one worker; they wait, the workers compute."""

    head: bytes
    tasks: Sequence[bytes]
    open: deque[int] = field(default_factory=deque)
    answers: queue.Queue[tuple[int, Answer]] = field(default_factory=queue.Queue)
    ready: threading.Condition = field(default_factory=threading.Condition)
    stopping: bool = False
    running: set[subprocess.Popen[bytes]] = field(default_factory=set)
    threads: list[threading.Thread] = field(default_factory=list)

    def start(self, workers: int) -> None:
        """Begin with all tasks."""
        self.open.extend(range(len(self.tasks)))
        for _ in range(workers):
            thread = threading.Thread(target=self._serve, daemon=True)
            thread.start()
            self.threads.append(thread)

    def next_answer(self) -> tuple[int, Answer]:
        """Position and answer of the next run that ends; it can be interrupted."""
        while True:
            try:
                return self.answers.get(timeout=_POLL_INTERVAL_S)
            except queue.Empty:
                continue

    def put_back(self, at: int) -> None:
        """A task that is to be done again, before all others."""
        with self.ready:
            self.open.appendleft(at)
            self.ready.notify()

    def stop(self) -> None:
        """End all workers, whatever they do."""
        with self.ready:
            self.stopping = True
            self.ready.notify_all()
            for process in self.running:
                process.kill()
        for thread in self.threads:
            thread.join()

    def _next_task(self) -> int | None:
        with self.ready:
            while not self.open and not self.stopping:
                self.ready.wait()
            return None if self.stopping else self.open.popleft()

    def _serve(self) -> None:
        """Tasks one after another; a worker that dies is replaced for the next task."""
        process: subprocess.Popen[bytes] | None = None
        try:
            while (at := self._next_task()) is not None:
                if process is None:
                    process, trouble = self._started()
                    if process is None:
                        self.answers.put((at, trouble))
                        return
                answer = _asked(process, self.tasks[at])
                if answer is None:
                    self.answers.put((at, ("died", self._ended(process))))
                    process = None
                else:
                    self.answers.put((at, answer))
        finally:
            if process is not None:
                self._ended(process)

    def _started(self) -> tuple[subprocess.Popen[bytes] | None, Answer]:
        """A worker that has loaded the work; None with the reason."""
        try:
            process = _popen()
        except OSError as error:
            return None, ("no-worker", error.strerror or str(error))
        with self.ready:
            self.running.add(process)
            if self.stopping:
                process.kill()
        answer = _asked(process, self.head)
        if answer is not None and answer[0] == "ready":
            return process, answer
        status = self._ended(process)
        return None, answer or ("no-worker", f"it ended at once, exit status {status}")

    def _ended(self, process: subprocess.Popen[bytes]) -> int:
        """The exit status of a worker that is no longer wanted."""
        with self.ready:
            self.running.discard(process)
        # its end of the pipe may be closed already
        for stream in (process.stdin, process.stdout):
            try:
                if stream is not None:
                    stream.close()
            except OSError:
                continue
        return process.wait()


def _popen() -> subprocess.Popen[bytes]:
    environment = {**os.environ, **dict.fromkeys(_THREADS, "1")}
    # Ctrl-C is for the parent, which ends its workers
    own_group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
    group: dict[str, Any] = {"creationflags": own_group} if sys.platform == "win32" else {"process_group": 0}
    command = [sys.executable, "-c", _program()]
    return subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=-1, **group
    )


def _program() -> str:
    """Finds femtune where this process has found it."""
    return f"import sys; sys.path[:] = {sys.path!r}; from femtune.executor.worker import main; main()"


def _asked(process: subprocess.Popen[bytes], message: bytes) -> Answer | None:
    """The answer to the work or to a task; None if the worker is gone."""
    inlet, outlet = process.stdin, process.stdout
    assert inlet is not None
    assert outlet is not None
    try:
        write(inlet, message)
        answer: Answer = pickle.loads(read(outlet))
    except (OSError, EOFError):
        return None
    return answer
