"""Calibrations with FRFs on reduced models that are killed at any moment, or whose disk is full, and started again."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import femtune as ft
from femtune.steps.run_folder import read_results

from .cantilever import Bench
from .damped_cantilever import DAMPED, PARAMETERS, TRULY, functions, study_of

_RUN = "import sys; import femtune as ft; ft.run(sys.argv[1])"
_LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
from femtune.cli import main
sys.exit(main([sys.argv[3], sys.argv[1], "--quiet"]))
"""
_BOOTSTRAP = "[bootstrap]\nruns = 30\nchecked = 2\n"
_STARTS = f"[update]\nstarts = 4\nsamples = 6\n{_BOOTSTRAP}"
_STAGES = """
[[stage]]
name = "stiffness"
parameters = ["root", "tip"]
residuals = ["frf"]
to_hz = 120.0
[[stage]]
name = "damping"
parameters = ["loss", "joint"]
residuals = ["frf"]
"""
_FILES = ("starts.jsonl", "bootstrap.jsonl")


def _study(bench: Bench, tables: str) -> Path:
    bench.functions(functions(bench.truth(TRULY, DAMPED), 0.002))
    return study_of(bench, f'kind = "frf"\nfloor = 0.002\nmost = 60\n[reduction]\n{tables}', PARAMETERS)


def _lines(folder: Path) -> dict[str, list[str]]:
    """Whole lines of the files of finished runs."""
    found = {}
    for name in _FILES:
        path = folder / name
        text = path.read_text("utf-8") if path.exists() else ""
        found[name] = text.split("\n")[:-1]
    return found


def _same(folder: Path, whole: Path) -> None:
    """Every number of the results and of the arrays, to the last bit."""
    (one, arrays), (other, others) = read_results(folder), read_results(whole)
    # the time of a bootstrap is that of its last part, and it counts the runs of earlier parts; a start that ended in
    # an earlier part is known by its end, without its iterations
    apart = {
        "provenance": True, "journal": True, "alerts": True, "bootstrap": {"seconds", "recalled"},
        "update": {"history", "iteration"},
    }  # fmt: skip
    assert one.model_dump(exclude=apart) == other.model_dump(exclude=apart)
    assert arrays.keys() == others.keys()
    for key, array in others.items():
        if re.fullmatch(r"update/frf_\d+_values", key):  # by iteration: known at the end only, as the history is
            np.testing.assert_array_equal(arrays[key][-1], array[-1])
        else:
            np.testing.assert_array_equal(arrays[key], array)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(
    ("tables", "seed", "times"),
    [
        pytest.param(_STARTS, 0, 2, id="starts", marks=pytest.mark.long),
        pytest.param(_STAGES, 2, 1, id="stages"),
        pytest.param(_STARTS, 1, 4, id="starts, again and again", marks=pytest.mark.long),
        pytest.param(_STAGES, 3, 4, id="stages, again and again", marks=pytest.mark.long),
    ],
)
def test_killed_at_random_moments(bench: Bench, tables: str, seed: int, times: int) -> None:
    study = _study(bench, tables)
    begun = time.monotonic()
    subprocess.run([sys.executable, "-c", _RUN, str(study)], check=True)
    took = time.monotonic() - begun
    folder, whole = bench.folder / "run", bench.folder / "whole"
    folder.rename(whole)
    chance, killed, kept = np.random.default_rng(seed), 0, _lines(folder)
    while killed < times:
        process = subprocess.Popen([sys.executable, "-c", _RUN, str(study)])
        try:
            process.wait(chance.uniform(0.1, 1.0) * took)
            if killed:
                break
            # the machine is faster now than in the first run
            took /= 2.0
            shutil.rmtree(folder)
            continue
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
            killed += 1
        after = _lines(folder)
        for name in _FILES:
            # no finished run is lost, nor written in another way
            assert after[name][: len(kept[name])] == kept[name]
        kept = after
    ft.run(study)
    assert all(_lines(folder)[name][: len(kept[name])] == kept[name] for name in _FILES)
    _same(folder, whole)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of files")
@pytest.mark.parametrize("limit", [pytest.param(500, marks=pytest.mark.long), 20_000])
def test_a_full_disk_is_told_and_the_run_goes_on_later(bench: Bench, limit: int) -> None:
    """No file may become larger than some bytes, as on a disk that is full when it is reached."""
    study = _study(bench, _STARTS)
    ended = subprocess.run(
        [sys.executable, "-c", _LIMITED, str(study), str(limit), "run"], check=False, capture_output=True, text=True
    )
    assert ended.returncode not in (0, -signal.SIGXFSZ)
    told = ended.stdout + ended.stderr
    assert "Traceback" not in told
    assert "run.unwritable" in told or "run.disk-full" in told
    assert "space" in told
    folder = bench.folder / "run"
    kept = _lines(folder)
    for line in (text for lines in kept.values() for text in lines):
        assert isinstance(json.loads(line), dict)
    ft.run(study)
    assert all(_lines(folder)[name][: len(kept[name])] == kept[name] for name in _FILES)
    folder.rename(bench.folder / "resumed")
    ft.run(study)
    _same(bench.folder / "resumed", folder)
