"""Runs on the workers of a Dask cluster, which somebody has started and which is named by its address."""

from __future__ import annotations

import ipaddress
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar
from urllib.parse import urlsplit

from femtune._optional import require
from femtune.errors import FemtuneError, Notice
from femtune.executor.interface import nothing
from femtune.executor.processes import error_of
from femtune.executor.worker import answer, packed

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Cluster:
    """Workers of a Dask cluster; needs the extra ``cluster``.

    Client and workers run what the other sends, so that an address outside of this machine must be wanted. The numbers
    are those of `Serial` to the last bit if the workers have the same processor and libraries, and one thread.

    Parameters
    ----------
    address : of the scheduler: "tcp://127.0.0.1:8786"
    remote : whether it may be on another machine
    timeout_s : for the connection
    """

    address: str
    remote: bool = False
    timeout_s: float = 15.0

    @property
    def words(self) -> str:
        """Name in results and reports."""
        return f"the Dask cluster at {self.address}"

    def run(
        self,
        work: Callable[[T], R],
        tasks: Sequence[T],
        *,
        name: str = "run",
        finished: Callable[[int, R], None] = nothing,
        remark: Callable[[Notice], None] = nothing,
    ) -> list[R]:
        """See `Executor`; errors ``executor.not-loopback``, ``executor.no-cluster``, ``install.missing`` too."""
        self._check_address()
        distributed = require("distributed", extra="cluster")
        if not len(tasks):
            return []
        head, sent = packed(work), [packed(task) for task in tasks]
        with self._client(distributed) as client:
            # nothing can be sent to a cluster whose workers have not begun, or have all ended
            try:
                client.wait_for_workers(1)
                shared = client.scatter(head, broadcast=True, hash=False)
                futures = client.map(_made, [shared] * len(sent), sent, pure=False)
            except (OSError, RuntimeError) as error:
                raise FemtuneError("executor.no-cluster", address=self.address, reason=_cause(error)) from error
            return _gathered(distributed, client, futures, name, finished)

    def check(self, waiting: Callable[[], None] = nothing) -> None:
        """Connect once, before anything is computed, and wait for the first worker (errors as `run`).

        Parameters
        ----------
        waiting : is called if there is no worker yet: the jobs that start them may be in a queue
        """
        self._check_address()
        with self._client(require("distributed", extra="cluster")) as client:
            if not client.nthreads():
                waiting()
                client.wait_for_workers(1)

    def _check_address(self) -> None:
        """Refuse addresses of other machines, unless they are wanted."""
        host = urlsplit(self.address if "//" in self.address else f"tcp://{self.address}").hostname or ""
        if not self.remote and not _is_loopback(host):
            raise FemtuneError("executor.not-loopback", address=self.address)

    def _client(self, distributed: Any) -> Any:
        try:
            return distributed.Client(self.address, timeout=self.timeout_s, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise FemtuneError("executor.no-cluster", address=self.address, reason=error) from error


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _gathered(
    distributed: Any, client: Any, futures: list[Any], name: str, finished: Callable[[int, Any], None]
) -> list[Any]:
    place = {future.key: i for i, future in enumerate(futures)}
    results: dict[int, Any] = {}
    try:
        for future in distributed.as_completed(futures, loop=client.loop):
            at = place[future.key]
            kind, value = answer_of(distributed, future)
            if kind != "done":
                raise error_of(kind, value, name, at)
            results[at] = value
            finished(at, value)
    finally:
        # runs that nobody waits for any more
        for future in futures:
            future.cancel()
    return [results[i] for i in range(len(futures))]


def answer_of(distributed: Any, future: Any) -> tuple[str, Any]:
    """What came of a run on the cluster: the kind of answer, and its value."""
    try:
        kind, value = pickle.loads(future.result())
    except distributed.KilledWorker:
        return "killed", None
    except Exception as error:
        # no error of a run, which would have been an answer
        return "not-made", _cause(error)
    return kind, value


def _cause(error: BaseException) -> str:
    """What is at the bottom of an error of the cluster: the library wraps it in others."""
    while error.__cause__ is not None:
        error = error.__cause__
    return f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"


def _made(head: bytes, task: bytes) -> bytes:
    """On a worker of the cluster."""
    try:
        work = _work(head)
    except Exception as error:
        return pickle.dumps(("not-loaded", f"{type(error).__name__}: {error}"))
    return answer(work, task)


@lru_cache(maxsize=2)
def _work(head: bytes) -> Any:
    """The work, loaded once."""
    return pickle.loads(head)
