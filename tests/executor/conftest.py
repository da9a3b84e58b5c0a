"""A Dask cluster on this machine, for the tests of executors."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from femtune.executor import Cluster

_ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """Two workers on this machine."""
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, env={"OMP_NUM_THREADS": "1"}
    ) as local:
        with distributed.Client(local, set_as_default=False) as client:
            client.run(sys.path.insert, 0, str(_ROOT))
        yield Cluster(local.scheduler_address)
