"""Runs on a Dask cluster: the same results, and addresses of this machine only."""

from __future__ import annotations

import socket
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.executor.runs import Solve, breaks, refuses
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.executor import Cluster, Serial
from femtune.executor.cluster import answer_of
from femtune.executor.processes import error_of

_ROOT = Path(__file__).resolve().parents[2]


pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.slow
def test_a_cluster_is_serial_to_the_last_bit(cluster: Cluster) -> None:
    kept = {}
    found = cluster.run(Solve(8), range(12), finished=kept.__setitem__)
    assert found == Serial().run(Solve(8), range(12))
    assert kept == dict(enumerate(found))
    assert cluster.run(Solve(8), []) == []


@pytest.mark.slow
def test_errors_of_runs_name_the_run(cluster: Cluster) -> None:
    with pytest.raises(FemtuneError) as error:
        cluster.run(refuses, range(8), name="start")
    assert error.value.values == {"start": 4, "task": 3}
    with pytest.raises(FemtuneError, match=r"start 3 .*ZeroDivisionError"):
        cluster.run(breaks, [5, 6, 2], name="start")


@pytest.mark.parametrize("address", ["tcp://10.0.0.7:8786", "10.0.0.7:8786", "tcp://cluster.example:8786", "tcp://"])
def test_other_machines_are_refused(address: str) -> None:
    with pytest.raises(FemtuneError) as error:
        Cluster(address).run(abs, [1])
    assert error.value.code == "executor.not-loopback"
    if address == "tcp://10.0.0.7:8786":
        check_shown("executor.not-loopback", error.value)


def test_a_scheduler_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError("Timed out trying to connect")

    monkeypatch.setattr("femtune.executor.cluster.require", lambda *_, **__: SimpleNamespace(Client=refuse))
    with pytest.raises(FemtuneError) as error:
        Cluster("tcp://127.0.0.1:8786").run(abs, [1])
    check_shown("executor.no-cluster", error.value)
    with pytest.raises(FemtuneError) as error:
        Cluster("tcp://127.0.0.1:8786").check()
    assert error.value.code == "executor.no-cluster"


@pytest.mark.slow
def test_workers_that_begin_later_are_waited_for() -> None:
    """As those of jobs in a queue: the scheduler is there, and its workers are not."""
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with distributed.LocalCluster(n_workers=0, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as local:
        cluster, told = Cluster(local.scheduler_address), []

        def begin() -> None:
            told.append("waiting")
            local.scale(1)

        cluster.check(begin)
        assert told == ["waiting"]
        assert cluster.run(abs, [-3]) == [3]
        cluster.check(begin)
        assert told == ["waiting"]


@pytest.mark.slow
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_nobody_answers(host: str) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(FemtuneError) as error:
        Cluster(f"tcp://{host}:{port}", timeout_s=0.5).run(abs, [1])
    assert error.value.code == "executor.no-cluster"


def test_a_scheduler_without_femtune_is_told() -> None:
    """The library raises errors of its own on runs that it could not make: no internal error of femtune."""

    class Run:
        def result(self) -> bytes:
            raise RuntimeError("Error during deserialization") from ModuleNotFoundError("No module named 'femtune'")

    library = SimpleNamespace(KilledWorker=KeyError)
    kind, value = answer_of(library, Run())
    error = error_of(kind, value, "start", 2)
    assert error.code == "executor.not-sent"
    assert "start 3: ModuleNotFoundError: No module named 'femtune'" in str(error)
