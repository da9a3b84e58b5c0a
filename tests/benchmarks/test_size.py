"""The benchmark at size: what it counts was checked, it goes on where it was ended, and its quick form runs."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from femtune.model.linear.symmetric import SymmetricMatrix, symmetric

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "size"
NAMES = ("checks", "goals", "journal", "plan", "process", "summary", "tables")


@pytest.fixture(scope="module")
def bench() -> Iterator[dict[str, ModuleType]]:
    """Its modules by name; they import one another as scripts of one folder do."""
    # other tests import folders of the same names, such as examples/cases
    names = [path.stem for path in FOLDER.glob("*.py")]
    before = {name: sys.modules.pop(name) for name in names if name in sys.modules}
    sys.path.insert(0, str(FOLDER))
    try:
        yield {name: importlib.import_module(name) for name in NAMES}
    finally:
        sys.path.remove(str(FOLDER))
        for name in names:
            sys.modules.pop(name, None)
        sys.modules.update(before)


def row(way: str, repeat: int, seconds: float, **other: object) -> dict:
    stages = {
        "analyse": {"seconds": 1.0, "cpu_seconds": 1.0, "peak_mib": 900.0},
        "50 modes": {"seconds": seconds, "cpu_seconds": seconds, "peak_mib": 1000.0},
        "derivatives": {"seconds": 4.0, "cpu_seconds": 4.0, "peak_mib": 1000.0},
    }
    return {
        "case": "subframe", "size": 100, "equations": 100, "way": way, "repeat": repeat, "stages": stages, "load": 0.0,
        "peak_mib": 1000.0, "children_mib": 24.0, "status": "ok", "why": "",
        "derivative_error": {"eigenvalues": 1e-12, "shapes": 1e-6}, **other,
    }  # fmt: skip


def test_modes_that_are_not_right_are_found_out(bench: dict[str, ModuleType]) -> None:
    n, shift = 30, -0.5
    stiffness, masses = np.diag(np.full(n, 2.0)) - np.eye(n, k=1) - np.eye(n, k=-1), np.linspace(1.0, 2.0, n)
    K = symmetric(sp.csr_array(stiffness))
    M = SymmetricMatrix(np.zeros(len(K.data)), K.indices, K.indptr)
    M.data[M.indptr[:-1]] = masses
    values, shapes = la.eigh(stiffness, np.diag(masses))
    check = bench["checks"].check_modes
    assert check((K, M), shift, values[:5], shapes[:, :5]).wrong() == ""
    tilted = shapes[:, :5] + 1e-6 * shapes[:, [9]]
    assert "energy" in check((K, M), shift, values[:5], tilted).wrong()
    assert "orthonormal" in check((K, M), shift, values[:5], 1.001 * shapes[:, :5]).wrong()


def test_rigid_body_modes_are_compared_by_their_squares(bench: dict[str, ModuleType]) -> None:
    difference = bench["checks"].frequency_difference
    assert difference(np.array([3e-4, 100.0, 200.0]), np.array([0.0, 100.0, 200.0])) < 1e-11
    assert difference(np.array([0.0, 100.0, 200.0002]), np.array([0.0, 100.0, 200.0])) == pytest.approx(1e-6, rel=1e-3)
    assert difference(np.array([0.0, 100.0]), np.array([0.0, 100.0, 200.0])) == np.inf


def test_a_journal_that_was_cut_goes_on(bench: dict[str, ModuleType], tmp_path: Path) -> None:
    run, journal = bench["journal"].Run, bench["journal"].Journal(tmp_path / "a" / "journal.jsonl")
    journal.add(run("subframe", 100, "femtune", 0), {"status": "ok"})
    journal.add(run("subframe", 100, "slepc", 0), {"status": "failed"})
    journal.path.write_text(journal.path.read_text() + '{"case": "subf')
    assert journal.done(run("subframe", 100, "femtune", 0))
    assert not journal.done(run("subframe", 100, "slepc", 0))
    journal.add(run("subframe", 100, "slepc", 0), {"status": "ok"})
    assert [r["status"] for r in journal.rows] == ["ok", "ok"]


@pytest.mark.slow
def test_a_run_beyond_its_limit_is_ended_with_its_children(bench: dict[str, ModuleType], tmp_path: Path) -> None:
    parent = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import time; time.sleep(60)'])"
    run, limits = bench["process"].run_within, bench["process"].Limits
    start = time.monotonic()
    ended = run([sys.executable, "-c", parent], {}, tmp_path / "log", limits(1.5, 4.0))
    assert time.monotonic() - start < 15.0
    assert ended.over == "> 2 s"
    assert ended.code != 0
    assert ended.children_mib > 1.0
    hungry = [sys.executable, "-c", "import time; x = bytearray(2**28); x[::4096] = b'a' * 2**16; time.sleep(60)"]
    assert run(hungry, {}, tmp_path / "log", limits(60.0, 0.2)).over == "> 0.2 GiB"


@pytest.mark.parametrize(
    ("found", "status"),
    [
        ({"wrong": "", "freq_hz": [[100.0]]}, "ok"),
        ({"wrong": "not mass-orthonormal: 1e-3", "freq_hz": [[100.0]]}, "wrong"),
        ({"wrong": "", "freq_hz": [[100.1]]}, "wrong"),
        ({"wrong": "", "freq_hz": [[100.0]], "derivative_error": {"shapes": 2e-4}}, "wrong"),
    ],
)
def test_a_wrong_result_does_not_count(bench: dict[str, ModuleType], found: dict, status: str) -> None:
    run = bench["journal"].Run("subframe", 100, "femtune", 1)
    judged = bench["plan"].judged(dict(found), run, {"freq_hz": [[100.0]]})
    assert judged["status"] == status
    assert bool(judged["why"]) == (status == "wrong")


def test_medians_exponents_and_goals(bench: dict[str, ModuleType]) -> None:
    times = (5.0, 100.0, 6.0, 4.0)
    rows = [row("femtune", i, s) for i, s in enumerate(times)]
    rows[3] |= {"status": "wrong", "why": "not so"}
    factor = {"factorise": {"seconds": 2.0, "cpu_seconds": 2.0, "peak_mib": 1.0}}
    peer = row("eigsh-pardiso", 0, 10.5)
    peer["stages"] |= factor
    ways = bench["summary"].summaries([*rows, peer])["subframe", 100]
    assert ways["femtune"].modes() == 7.0
    assert ways["eigsh-pardiso"].modes() == 13.5
    assert ways["femtune"].peak_gib() == 1.0
    modes, again, derivatives, error, memory = bench["goals"].goals(ways)
    assert (modes.verdict, again.verdict, derivatives.verdict) == ("not met", "not measured", "met")
    assert modes.measured.startswith("1.93 ×")
    assert (error.verdict, memory.verdict) == ("met", "met")
    assert bench["summary"].exponent([1e4, 1e5, 1e6], [3 * n**1.2 for n in (1e4, 1e5, 1e6)]) == pytest.approx(1.2)


@pytest.mark.long
def test_the_quick_form_measures_all_and_a_second_start_has_nothing_to_do(tmp_path: Path) -> None:
    command = [sys.executable, str(FOLDER / "run.py"), "--quick", "--folder", str(tmp_path / "runs")]
    first = subprocess.run([*command, "--evidence", str(tmp_path)], capture_output=True, text=True, check=False)
    assert first.returncode == 0, first.stdout + first.stderr
    rows = json.loads((tmp_path / "benchmark_size.json").read_text())["rows"]
    assert {(r["case"], r["way"]) for r in rows} >= {(c, w) for c in ("subframe", "bracket") for w in ("femtune",)}
    assert {r["status"] for r in rows} == {"ok"}
    page = (tmp_path / "benchmark_size.md").read_text()
    assert "## Shell subframe" in page
    assert "## Solid bracket" in page
    assert (tmp_path / "benchmark_size.svg").stat().st_size > 5_000
    journal = (tmp_path / "runs" / "journal.jsonl").read_text()
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert again.returncode == 0
    assert "#0:" not in again.stdout
    assert (tmp_path / "runs" / "journal.jsonl").read_text() == journal
