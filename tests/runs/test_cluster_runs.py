"""External runs on the workers of a Dask cluster of this machine: what threads give, each once, with the journal."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.runs.fake import SCRIPT as FAKE
from tests.runs.fake import exact_hz, fail, fake_solver, started
from tests.study.two_masses import TRUTH, prepared, values
from tests.study.two_masses import started as started_of_study

import femtune as ft
from femtune.executor import Cluster
from femtune.journal.runs import open_run_journal
from femtune.runs import Template, Templates, evaluate

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return prepared(tmp_path)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with distributed.LocalCluster(
        n_workers=3, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, env={"OMP_NUM_THREADS": "1"}
    ) as local:
        yield Cluster(local.scheduler_address)


def test_runs_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    solver, journal = fake_solver(tmp_path), open_run_journal(tmp_path)
    points = [{"k1": 50.0 + i, "k2": 90.0 - i, "point": i} for i in range(30)]
    fail(tmp_path, 3, "crash", 9)
    fail(tmp_path, 7, "truncated", 1)
    found = evaluate(solver, points, cluster, journal)
    assert found.failed == (3,)
    assert [f.kind.value for f in found.outcomes[7].failures] == ["unreadable output"]
    for point, outcome in zip(points, found.outcomes):
        if outcome.modes is not None:
            np.testing.assert_allclose(outcome.modes.freq_hz, exact_hz(point["k1"], point["k2"]), rtol=1e-11)
    assert started(tmp_path) == 30 + 2
    assert evaluate(solver, points, cluster, journal).started == 0
    assert started(tmp_path) == 30 + 2
    journal.close()


def test_a_study_on_a_cluster(cluster: Cluster, study: Path) -> None:
    study.write_text(study.read_text() + f'\n[parallel]\nhow = "cluster"\naddress = "{cluster.address}"\n')
    result = ft.run(study)
    np.testing.assert_allclose(values(result), TRUTH, rtol=1e-5)
    before = started_of_study(study)
    # the same study in threads: nothing is run again
    study.write_text(study.read_text().partition("\n[parallel]")[0])
    assert values(ft.run(study)).tolist() == values(result).tolist()
    assert started_of_study(study) == before


def test_a_worker_that_dies_is_replaced(cluster: Cluster, tmp_path: Path) -> None:
    """The run kills its worker once; the scheduler gives it to another one."""
    died = "os.environ['FAKE_STATE'] + '/died'"
    script = f"import os, signal\nif not os.path.exists({died}):\n    open({died}, 'w').close()\n"
    script += f"    os.kill(os.getppid(), signal.SIGKILL)\n{FAKE}"
    numbers = Template.of_text("in.txt", "{{k1:.12g}}\n{{k2:.12g}}\n{{point:.12g}}\n")
    solver = replace(fake_solver(tmp_path), inputs=Templates((numbers, Template.of_text("solve.py", script))))
    found = evaluate(solver, [{"k1": 4.0, "k2": 9.0, "point": 1}], cluster)
    assert found.failed == ()
    assert (tmp_path / "state" / "died").exists()
