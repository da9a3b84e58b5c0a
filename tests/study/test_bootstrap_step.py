"""[bootstrap] through whole runs: results and report, interrupted runs, refusals."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.messages.shown import check_shown

import femtune as ft
from femtune.errors import FemtuneError
from femtune.steps.bootstrap.run import BOOTSTRAP_FILE
from femtune.steps.run.result import RunResult

from .cantilever import EI, TRUE, Bench
from .damped_cantilever import DAMPED, functions, study_of

FRF = 'kind = "frf"\ncount = 12\nmost = 40\nto_hz = 150.0\nfloor = 0.003\n'
TABLE = "\n[bootstrap]\nruns = {runs}\nseed = 3\nchecked = 2\n"


def bootstrapped(bench: Bench, runs: int = 12, more: str = "", table: str = TABLE, frf: str = FRF) -> Path:
    if not (bench.folder / "frfs.uff").exists():
        bench.functions(functions(bench.truth(TRUE, DAMPED), 0.003))
    return study_of(bench, f"{frf}{table.format(runs=runs)}{more}", EI)


def check_same(run: RunResult, whole: RunResult) -> None:
    """The same numbers to the last bit."""
    one, other = run.results.bootstrap, whole.results.bootstrap
    assert one is not None
    assert other is not None
    apart = {"seconds", "recalled", "executor"}
    assert one.model_dump(exclude=apart) == other.model_dump(exclude=apart)
    np.testing.assert_array_equal(run.arrays[one.samples_key], whole.arrays[other.samples_key])


@pytest.mark.slow
def test_a_run_with_a_bootstrap(bench: Bench) -> None:
    run = ft.run(bootstrapped(bench))
    found = run.results.bootstrap
    assert found is not None
    # five of the forty lines are below the noise in all functions
    assert (found.runs, found.converged, found.drawn_from, found.checked) == (12, 12, 35, 2)
    assert run.arrays[found.samples_key].shape == (12, 2)
    assert found.largest_difference is not None
    assert found.largest_difference < 0.1
    for p, sample in zip(found.parameters, run.arrays[found.samples_key].T):
        assert p.value == run.values[p.parameter]
        assert p.mean == pytest.approx(sample.mean())
        assert p.cov_percent == pytest.approx(100.0 * sample.std(ddof=1) / sample.mean())
    assert [c.key for c in found.citations] == ["efron1993", "hesterberg2015"]
    update, selection = run.results.update, run.results.selection
    assert update is not None
    assert update.fisher is not None
    assert selection is not None
    assert selection.fisher is not None
    assert (selection.fisher.stage, update.fisher.stage, update.fisher.measured) == ("before", "after", False)
    for p, q in zip(update.fisher.parameters, found.parameters):
        assert p.sd_percent == pytest.approx(q.fisher_cov_percent, rel=1e-3)
    page = run.report.read_text(encoding="utf-8") if run.report else ""
    assert "Bootstrap of the FRFs" in page
    assert "Expected standard deviations from the FRFs, in % of the parameter" in page
    assert "Distribution of the parameters over the runs" in page
    assert "Correlation of the parameters over the runs" in page
    assert [row.parameter for row in run.bootstrap] == ["root", "tip"]
    # the second time nothing is made again, and processes give the same numbers
    again = ft.bootstrap(bootstrapped(bench))
    assert again.results.bootstrap is not None
    assert again.results.bootstrap.recalled == 12
    check_same(again, run)
    apart = ft.bootstrap(bootstrapped(bench, more='[parallel]\nhow = "processes"\nworkers = 2\n'), fresh=True)
    assert apart.results.bootstrap is not None
    assert apart.results.bootstrap.recalled == 0
    assert "2 worker processes" in apart.results.bootstrap.executor
    check_same(apart, run)
    # more runs begin with those that are there
    more = ft.bootstrap(bootstrapped(bench, 15))
    assert more.results.bootstrap is not None
    assert more.results.bootstrap.recalled == 12
    np.testing.assert_array_equal(more.arrays[found.samples_key][:12], run.arrays[found.samples_key])


@pytest.mark.slow
def test_runs_on_the_reduced_model_are_those_of_the_full_one(bench: Bench) -> None:
    plain = ft.run(bootstrapped(bench)).results.bootstrap
    run = ft.run(bootstrapped(bench, more="[reduction]\n"), fresh=True)
    found, update = run.results.bootstrap, run.results.update
    assert plain is not None
    assert found is not None
    assert update is not None
    assert update.reduction is not None
    assert plain.reduced_orders == ()
    assert len(found.reduced_orders) == 1
    assert found.reduced_orders[0] >= update.reduction.models[0].order
    assert "made on a reduced model of order" in found.sentences[-1]
    for one, other in zip(found.parameters, plain.parameters):
        assert one.value == pytest.approx(other.value, abs=0.05 * other.sd)
        assert one.mean == pytest.approx(other.mean, abs=0.05 * other.sd)
        assert one.sd == pytest.approx(other.sd, rel=0.05)


# ends itself without any farewell: before a run is kept, after it, or in the middle of its line
_KILLED = """
import os, signal, sys
import femtune as ft
from femtune.journal import finished
study, when, last = sys.argv[1], sys.argv[2], int(sys.argv[3])
calls = 0
add = finished.FinishedRuns.add
def dying(self, line):
    global calls
    calls += 1
    if calls == last and when == "amid":
        text = finished._text(line).encode()
        with self.path.open("ab") as stream:
            stream.write(text[: len(text) // 2])
    if calls == last and when != "after":
        os.kill(os.getpid(), signal.SIGKILL)
    add(self, line)
    if calls == last:
        os.kill(os.getpid(), signal.SIGKILL)
finished.FinishedRuns.add = dying
ft.bootstrap(study)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    ("how", "moments"),
    [
        ("serial", [("amid", 7, 6)]),
        pytest.param("serial", [("after", 12, 12)], marks=pytest.mark.long),
        pytest.param("serial", [("before", 1, 0)], marks=pytest.mark.long),
        ("processes", [("amid", 5, 4)]),
    ],
)
def test_killed_at_any_moment(bench: Bench, how: str, moments: list[tuple[str, int, int]]) -> None:
    study = bootstrapped(bench, more=f'[parallel]\nhow = "{how}"\nworkers = 2\n')
    whole = ft.bootstrap(study)
    file = bench.folder / "run" / BOOTSTRAP_FILE
    for when, last, kept in moments:
        file.unlink()
        ended = subprocess.run([sys.executable, "-c", _KILLED, str(study), when, str(last)], check=False)
        assert ended.returncode == -signal.SIGKILL
        before = file.read_bytes()
        again = ft.bootstrap(study)
        assert again.results.bootstrap is not None
        assert again.results.bootstrap.recalled == kept
        # lines that were whole are still the first ones
        assert file.read_bytes().startswith(before[: before.rfind(b"\n") + 1])
        check_same(again, whole)


@pytest.mark.slow
def test_runs_of_other_data_are_not_used(bench: Bench) -> None:
    first = ft.bootstrap(bootstrapped(bench))
    other = ft.bootstrap(bootstrapped(bench, frf=FRF.replace("most = 40", "most = 30")))
    assert first.results.bootstrap is not None
    assert other.results.bootstrap is not None
    assert other.results.bootstrap.recalled == 0
    assert first.results.bootstrap.parameters != other.results.bootstrap.parameters
    # a line that is none is made again
    file = bench.folder / "run" / BOOTSTRAP_FILE
    head, *lines = file.read_text().splitlines()
    spoilt = [{**json.loads(line), "x": ["far", 1.0]} if i == 3 else json.loads(line) for i, line in enumerate(lines)]
    file.write_text("\n".join([head, *map(json.dumps, spoilt), ""]))
    again = ft.bootstrap(bootstrapped(bench, frf=FRF.replace("most = 40", "most = 30")))
    assert again.results.bootstrap is not None
    assert again.results.bootstrap.recalled == 11
    check_same(again, other)


@pytest.mark.slow
def test_modes_have_no_lines(beam: Bench) -> None:
    with pytest.raises(FemtuneError, match="measured FRFs") as caught:
        ft.bootstrap(beam.study())
    assert caught.value.code == "bootstrap.no-lines"
    # reported before the update
    assert not (beam.folder / "run" / "history.jsonl").exists()
    noise = ft.bootstrap(beam.study(f'{beam.parameters}[bootstrap]\nmethod = "noise"\nruns = 200\n'))
    update, found = noise.results.update, noise.results.bootstrap
    assert update is not None
    assert found is not None
    # linear here: the standard deviations are those of the update, known to 5 % from 200 runs
    for p, q in zip(update.parameters, found.parameters):
        assert p.sd is not None
        assert q.sd == pytest.approx(p.sd, rel=0.25)


@pytest.mark.slow
def test_no_optimum(bench: Bench) -> None:
    run = ft.bootstrap(bootstrapped(bench, more="[update]\nmax_iterations = 1\n"))
    (told,) = [a for a in run.results.alerts if a.code == "bootstrap.not-converged"]
    check_shown("bootstrap.not-converged", f"[{told.code}] {told.sentence.removeprefix('bootstrap: ')}")


@pytest.mark.slow
def test_stages_have_no_bootstrap(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    stage = '[[stage]]\nname = "all"\nparameters = ["root", "tip"]\nresiduals = ["frf"]\n'
    monkeypatch.chdir(bench.folder)
    bootstrapped(bench, more=stage)
    with pytest.raises(FemtuneError) as caught:
        ft.bootstrap(Path("study.toml"))
    check_shown("bootstrap.stages", caught.value)
    assert not (bench.folder / "run" / "history.jsonl").exists()
