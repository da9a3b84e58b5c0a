"""Two thousand runs with injected failures, and a program that is killed ten times."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.runs.fake import exact_hz, fail, fake_solver, started

from femtune.executor import Threads
from femtune.journal.runs import open_run_journal
from femtune.runs import evaluate

_KINDS = {
    "crash": "exit code", "hang": "time-out", "truncated": "unreadable output", "nothing": "no output",
    "error": "error text", "one": "implausible modes",
}  # fmt: skip


@pytest.mark.long
def test_two_thousand_runs_of_which_a_twentieth_fails(tmp_path: Path) -> None:
    """Every failure is named, none is used, and those that pass give the closed form, modes in either order."""
    count, rng = 2000, np.random.default_rng(5)
    k = rng.uniform(50.0, 100.0, (count, 2))
    points = [{"k1": a, "k2": b, "point": i} for i, (a, b) in enumerate(k)]
    solver = fake_solver(tmp_path, timeout_s=3.0)
    bad = rng.choice(count, count // 20, replace=False)
    # few hang, since each takes as long as the time-out
    kinds = [("hang" if n < 4 else [*_KINDS][0 if n % 5 == 0 else n % 5 + 1]) for n in range(len(bad))]
    lasting = {int(i) for i in bad[::2]}
    for i, kind in zip(bad, kinds):
        fail(tmp_path, int(i), kind, 9 if int(i) in lasting else 1)
    found = evaluate(solver, points, Threads(4), open_run_journal(tmp_path))
    assert set(found.failed) == lasting
    for i, kind in zip(bad, kinds):
        outcome = found.outcomes[int(i)]
        assert {f.kind.value for f in outcome.failures} == {_KINDS[kind]}
        assert len(outcome.failures) == (2 if int(i) in lasting else 1)
    swapped = 0
    for i, outcome in enumerate(found.outcomes):
        if i in lasting:
            continue
        assert outcome.modes is not None
        np.testing.assert_allclose(outcome.modes.freq_hz, exact_hz(*k[i]), rtol=1e-11)
        first = int(np.argmax(np.abs(outcome.modes.shapes[:, 2, 0])))
        assert first == int(np.argmin(k[i]))
        swapped += first
        assert i in bad or not outcome.failures
    assert swapped > 500
    assert started(tmp_path) == count + len(bad)


_DRIVER = """
import sys
from pathlib import Path
from tests.runs.fake import fake_solver
from femtune.executor import Threads
from femtune.journal.runs import open_run_journal
from femtune.runs import evaluate
folder = Path(sys.argv[1])
solver = fake_solver(folder, environment=(("FAKE_STATE", str(folder / "state")), ("FAKE_S", "0.0")))
points = [{"k1": 4.0 + i, "k2": 9.0, "point": i} for i in range(int(sys.argv[2]))]
found = evaluate(solver, points, Threads(3), open_run_journal(folder))
print(found.started, len(found.failed))
"""


@pytest.mark.long
def test_a_program_that_is_killed_ten_times_repeats_only_what_was_under_way(tmp_path: Path) -> None:
    """Two thousand points, of which a twentieth fails: half of these once, half for good."""
    count, workers, rng = 2000, 3, np.random.default_rng(3)
    bad = rng.choice(count, count // 20, replace=False)
    command = [sys.executable, "-c", _DRIVER, str(tmp_path), str(count)]
    root = Path(__file__).resolve().parents[2]
    fake_solver(tmp_path)
    for n, i in enumerate(bad):
        fail(tmp_path, int(i), ["crash", "truncated", "nothing"][n % 3], 1 if n % 2 else 10_000)
    kills = 0
    for _ in range(10):
        before = started(tmp_path)
        process = subprocess.Popen(command, cwd=root, stdout=subprocess.DEVNULL)
        while started(tmp_path) == before and process.poll() is None:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 3.0))
        kills += process.poll() is None
        process.send_signal(signal.SIGKILL)
        process.wait()
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True, timeout=600)
    assert done.stdout.split()[1] == str(len(bad) // 2)
    assert kills == 10
    # every point that fails is tried twice; of a run under way both attempts may be made again
    needed = count + len(bad)
    assert needed <= started(tmp_path) <= needed + 2 * kills * workers
    journal = open_run_journal(tmp_path)
    assert sum(journal.states().values()) == count
    assert journal.states()["done"] == count - len(bad) // 2
    journal.close()


@pytest.mark.slow
def test_an_interruption_ends_the_solvers_that_run(tmp_path: Path) -> None:
    solver = replace(fake_solver(tmp_path), timeout_s=600.0, retries=5)
    for i in range(4):
        fail(tmp_path, i, "hang", 99)

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    points = [{"k1": 4.0, "k2": 9.0, "point": i} for i in (7, 0, 1, 2, 3)]
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        evaluate(solver, points, Threads(2), finished=stop)
    time.sleep(0.5)
    at_rest = started(tmp_path)
    time.sleep(0.5)
    assert started(tmp_path) == at_rest <= 4
    assert time.monotonic() - begin < 60.0
