"""Modes by SLEPc on two ranks against closed forms and against our own solution; and what is said where it fails."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.errors import FemtuneError
from femtune.model import Configuration, ModelPoint, configure, parametric_model, solve_modes
from femtune.model.distributed import SlepcModes, launch, processes, slepc_count, slepc_lowest, slepc_pairs
from femtune.model.eigen import slepc as eigen_slepc
from femtune.model.linear.symmetric import SymmetricMatrix, symmetric
from femtune.parameters import ParameterSet
from structures.springs import spring_structure


def grid(n: int) -> tuple[SymmetricMatrix, SymmetricMatrix]:
    """A free n × n net of unit springs with unit masses: λ_ij = 4 sin²(iπ/2n) + 4 sin²(jπ/2n), most of them twice."""
    chain = sp.diags_array(
        [-np.ones(n - 1), np.r_[1.0, 2.0 * np.ones(n - 2), 1.0], -np.ones(n - 1)], offsets=[-1, 0, 1]
    )
    one = sp.eye_array(n)
    return symmetric(sp.kron(chain, one) + sp.kron(one, chain)), symmetric(sp.eye_array(n * n))


def grid_values(n: int) -> np.ndarray:
    chain = 4.0 * np.sin(np.arange(n) * np.pi / (2 * n)) ** 2
    return np.sort(np.add.outer(chain, chain).ravel())


@pytest.fixture
def two_ranks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(launch.RANKS, "2")
    try:
        launch.start()
    except FemtuneError as absent:
        pytest.skip(f"no SLEPc over MPI here: {absent.what}")


@pytest.mark.usefixtures("two_ranks")
@pytest.mark.slow
def test_two_ranks_find_all_modes_of_a_free_net_with_repeated_ones() -> None:
    K, M = grid(30)
    modes = slepc_lowest(K, M, 25)
    values, shapes = modes.values, modes.shapes
    assert 0.0 < modes.errors.max() < 1e-9
    assert -0.1 < modes.shift < 0.0
    exact = grid_values(30)
    np.testing.assert_allclose(values, exact[:25], atol=1e-10)
    np.testing.assert_allclose(shapes.T @ (M @ shapes), np.eye(25), atol=1e-12)
    residual = K @ shapes - (M @ shapes) * values
    assert np.abs(residual).max() < 1e-8
    assert slepc_count(K, M, 3.1) == (exact < 3.1).sum()


def program(path: Path, text: str) -> str:
    """A Python that says it has slepc4py and then does what `text` says in the folder that it is given."""
    path.write_text(
        f"#!{sys.executable}\nimport sys\nfrom pathlib import Path\n"
        "if sys.argv[-1] == '--versions':\n    print('{\"slepc\": \"3.18\"}')\n    sys.exit()\n"
        f"folder = Path(sys.argv[-1])\n{text}\n",
        encoding="utf-8",
    )
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


RESULT = "import json, numpy as np\n(folder / 'result.json').write_text(json.dumps({result}))\n"
SHAPES = "np.save(folder / 'first_0.npy', 0)\nnp.save(folder / 'rows_0.npy', np.ones({size}))\n"
ONE = RESULT.format(result="{'ranks': 1, 'values': [1.0], 'errors': [0.0]}")
ENDINGS = {
    "failed": ("print('PETSc error 76', file=sys.stderr)\nsys.exit(3)", "slepc.failed", "PETSc error 76"),
    "killed": ("import os\nos.kill(os.getpid(), 9)", "slepc.failed", "-9"),
    "nothing": ("", "slepc.no-result", "result.json is missing"),
    "no shapes": (ONE, "slepc.no-result", "rank 0"),
    "nan": (RESULT.format(result="{'ranks': 1, 'values': [float('nan')], 'errors': 0}"), "slepc.no-result", "finite"),
    "too many": (RESULT.format(result="{'ranks': 1, 'values': [1.0] * 9, 'errors': 0}"), "slepc.no-result", "9 values"),
    "few errors": (
        RESULT.format(result="{'ranks': 1, 'values': [1.0, 2.0], 'errors': [0.0]}"),
        "slepc.no-result",
        "1 errors",
    ),
    "old program": (RESULT.format(result="{'ranks': 1}"), "slepc.no-result", "lacks errors, values"),
    "not a table": (RESULT.format(result="[3]"), "slepc.no-result", "table"),
    "words": (RESULT.format(result="{'ranks': 'x', 'values': 'y', 'errors': []}"), "slepc.no-result", "numbers"),
    "short": (ONE + SHAPES.format(size="(8, 1)"), "slepc.no-result", "8 rows"),
    "same shapes twice": (
        RESULT.format(result="{'ranks': 1, 'values': [1.0, 1.0], 'errors': [0.0, 0.0]}") + SHAPES.format(size="(9, 2)"),
        "slepc.no-result",
        "linearly dependent",
    ),
    "long": (ONE + SHAPES.format(size="(10, 1)"), "slepc.no-result", "(10, 1)"),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in is a script with a first line for Unix")
@pytest.mark.parametrize("ending", ENDINGS)
def test_every_bad_ending_is_told_and_the_files_are_removed(
    ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, code, said = ENDINGS[ending]
    monkeypatch.setenv(launch.PYTHON, program(tmp_path / "python", text))
    monkeypatch.setenv(launch.RANKS, "1")
    files = tmp_path / "files"
    files.mkdir()
    monkeypatch.setenv("FEMTUNE_SLEPC_FOLDER", str(files))
    with pytest.raises(FemtuneError) as caught:
        slepc_pairs(*grid(3), -0.1, 2)
    assert caught.value.code == code
    assert said in str(caught.value)
    assert not list(files.iterdir())


@pytest.mark.parametrize(
    ("variable", "value", "code"),
    [
        (launch.PYTHON, "/no/such/python", "slepc.not-installed"),
        (launch.RANKS, "two", "slepc.launcher"),
        (launch.RANKS, "0", "slepc.launcher"),
        (launch.RANKS, "1000000", "slepc.launcher"),
        (launch.RANKS, "9" * 5000, "slepc.launcher"),
        (processes.SECONDS, "soon", "slepc.launcher"),
        (processes.SECONDS, "nan", "slepc.launcher"),
        (processes.SECONDS, "0", "slepc.launcher"),
        (launch.LAUNCHER, "no-such-launcher -n 2", "slepc.launcher"),
        (launch.LAUNCHER, "mpirun 'two", "slepc.launcher"),
        ("FEMTUNE_SLEPC_FOLDER", "/no/such/folder", "slepc.files"),
    ],
)
def test_a_wrong_setting_is_told(
    variable: str, value: str, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(launch.PYTHON, program(tmp_path / "python", "sys.exit(1)"))
    monkeypatch.setenv(launch.RANKS, "1")  # which needs no launcher
    monkeypatch.setenv(variable, value)
    with pytest.raises(FemtuneError) as caught:
        slepc_pairs(*grid(3), -0.1, 2)
    assert caught.value.code == code
    assert value[:80] in str(caught.value) or value.split(maxsplit=1)[0] in str(caught.value)


posix = pytest.mark.skipif(sys.platform == "win32", reason="stand-ins are scripts with a first line for Unix")


def test_a_launcher_of_the_user_may_start_more_ranks_than_this_machine_bears(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(launch.RANKS, "5000")
    monkeypatch.setenv(launch.LAUNCHER, "srun -n 5000")
    assert launch.ranks() == 5000


@posix
@pytest.mark.parametrize("tool", ["/bin/cat", "/bin/true"])
def test_what_is_no_python_is_called_so(tool: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(launch.PYTHON, tool)
    with pytest.raises(FemtuneError) as caught:
        launch.slepc_python()
    assert "is no Python 3" in str(caught.value)


@posix
@pytest.mark.slow
def test_a_python_that_fails_is_not_called_another_thing() -> None:
    launch.probe.cache_clear()
    found, text = launch.probe(sys.executable)
    assert found or "is no Python" not in text


def _is_there(number: int) -> bool:
    try:
        text = Path(f"/proc/{number}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return False
    return text.rpartition(")")[2].split()[0] != "Z"


def _number_in(path: Path) -> int:
    until = time.monotonic() + 20.0
    while time.monotonic() < until:
        if path.exists() and path.read_text(encoding="ascii").strip():
            return int(path.read_text(encoding="ascii"))
        time.sleep(0.02)
    raise AssertionError(f"{path} did not come")


def _is_gone(number: int) -> bool:
    until = time.monotonic() + 5.0
    while _is_there(number) and time.monotonic() < until:
        time.sleep(0.02)
    return not _is_there(number)


linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are looked up in /proc")


@linux
@pytest.mark.slow
def test_processes_that_never_end_are_ended_with_their_children(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(processes.SECONDS, "0.5")
    command = ["/bin/sh", "-c", f"sleep 1000 & echo $! > {tmp_path / 'number'}; wait"]
    with pytest.raises(FemtuneError, match=r"took more than 0\.5 seconds") as caught:
        processes.run_to_end(command, dict(os.environ), tmp_path / "said.txt")
    assert caught.value.code == "slepc.timeout"
    assert _is_gone(_number_in(tmp_path / "number"))


@linux
def test_a_launcher_that_talks_without_end_does_not_fill_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "MOST_OUTPUT_BYTES", 1 << 20)
    talk = "import time\nwhile True: print('y' * 9999, flush=True); time.sleep(1e-3)"
    with pytest.raises(FemtuneError, match="wrote more than 1 MiB") as caught:
        processes.run_to_end([sys.executable, "-c", talk], dict(os.environ), tmp_path / "said.txt")
    assert caught.value.code == "slepc.failed"


@linux
def test_processes_end_with_a_femtune_that_is_killed(tmp_path: Path) -> None:
    number = tmp_path / "number"
    command = ["/bin/sh", "-c", f"echo $$ > {number}; exec sleep 1000"]
    text = (
        "import os\nfrom pathlib import Path\nfrom femtune.model.distributed import processes\n"
        f"processes.run_to_end({command!r}, dict(os.environ), Path({str(tmp_path / 'said.txt')!r}))"
    )
    parent = subprocess.Popen([sys.executable, "-c", text])
    child = _number_in(number)
    assert _is_there(child)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    assert _is_gone(child)


@posix
def test_settings_of_petsc_are_named_where_it_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PETSC_OPTIONS", "-st_pc_type none")
    monkeypatch.setenv(launch.PYTHON, program(tmp_path / "python", "sys.exit(3)"))
    monkeypatch.setenv(launch.RANKS, "1")
    with pytest.raises(FemtuneError) as caught:
        slepc_pairs(*grid(3), -0.1, 2)
    assert caught.value.values["PETSC_OPTIONS"] == "-st_pc_type none"
    spoiled = _modes([0.0, 1.0, 2.0, 3.0], [1e10] * 4)
    monkeypatch.setattr(eigen_slepc, "slepc_lowest", lambda K, M, count: spoiled)
    with pytest.raises(FemtuneError, match="residual") as inaccurate:
        eigen_slepc.solve_by_slepc(*grid(30), 3, None, _end)
    assert inaccurate.value.values["PETSC_OPTIONS"] == "-st_pc_type none"
    assert "PETSC_OPTIONS" in inaccurate.value.hint


def test_a_model_that_is_too_small_for_slepc_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not solve_modes(spring_net(3), 3).notices
    monkeypatch.setenv("FEMTUNE_EIGENSOLVER", "slepc")
    (notice,) = solve_modes(spring_net(3), 3).notices
    assert notice.code == "slepc.not-used"
    assert "9 DOFs" in str(notice)
    assert "400 DOFs" in str(notice)


def test_a_full_disk_is_told_before_matrices_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(launch.PYTHON, program(tmp_path / "python", "sys.exit(1)"))
    monkeypatch.setenv(launch.RANKS, "1")
    usage = type("Usage", (), {"free": 1000})
    monkeypatch.setattr("femtune.model.distributed.exchange.shutil.disk_usage", lambda path: usage)
    with pytest.raises(FemtuneError, match="too little space") as caught:
        slepc_pairs(*grid(3), -0.1, 2)
    assert caught.value.code == "slepc.files"
    assert caught.value.values["free_bytes"] == 1000


@pytest.mark.parametrize("ranks", [1, 2, 3, 7])
def test_ranks_share_all_rows(ranks: int) -> None:
    from femtune.model.distributed.program import rows_of  # noqa: PLC0415

    starts = np.concatenate([[0], np.cumsum(np.random.default_rng(ranks).integers(1, 50, 40))])
    shares = [rows_of(starts, rank, ranks) for rank in range(ranks)]
    assert [a for a, _ in shares] + [40] == [0, *(b for _, b in shares)]
    assert max(starts[b] - starts[a] for a, b in shares) < starts[-1] / ranks + 100


def spring_net(n: int) -> ModelPoint:
    """A free n × n net of unit springs in one direction, with unit masses."""
    at = np.arange(n * n).reshape(n, n)
    pairs = [*zip(at[:-1].ravel(), at[1:].ravel()), *zip(at[:, :-1].ravel(), at[:, 1:].ravel())]
    structure = spring_structure([(int(a), int(b), 1.0) for a, b in pairs], [1.0] * n * n)
    return configure(parametric_model(structure, ParameterSet(()), ()), Configuration("net")).at(np.zeros(0))


@pytest.mark.usefixtures("two_ranks")
@pytest.mark.slow
def test_modes_of_a_model_go_to_slepc_without_a_change(monkeypatch: pytest.MonkeyPatch) -> None:
    point = spring_net(21)
    monkeypatch.setenv("FEMTUNE_EIGENSOLVER", "slepc")
    found = solve_modes(point, 7)
    exact = grid_values(21)
    # the eighth is the pair of the seventh
    assert found.wanted == 8
    np.testing.assert_allclose(found.eigenvalues, exact[: len(found.eigenvalues)], atol=1e-9)
    assert found.sturm_count == (exact < found.sturm_shift).sum() >= 8
    assert found.known_factor is None
    np.testing.assert_allclose(
        found.factor.solve((found.eigenvalues[3] - found.shift) * found.shapes[:, 3]), found.shapes[:, 3], atol=1e-8
    )


def test_an_unknown_eigen_solver_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEMTUNE_EIGENSOLVER", "slep")
    with pytest.raises(FemtuneError, match="no eigenvalue solver 'slep'") as caught:
        solve_modes(spring_net(3), 2)
    assert caught.value.code == "solver.unavailable"
    assert caught.value.hint == "did you mean 'slepc'?"


def _modes(values: list[float], errors: list[float] | None = None) -> SlepcModes:
    n = len(values)
    return SlepcModes(np.array(values), np.eye(900, n), np.array(errors or [0.0] * n), -1.0)


def _end(values: np.ndarray, wanted: int, known: int, shift: float, complete: bool) -> tuple[int, tuple[float, int]]:
    return wanted, (values[wanted - 1] + 0.5, wanted)


def test_what_slepc_missed_or_spoiled_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    K, M = grid(30)
    monkeypatch.setattr(eigen_slepc, "slepc_count", lambda K, M, value: 4)
    monkeypatch.setattr(eigen_slepc, "slepc_lowest", lambda K, M, count: _modes([float(i) for i in range(count)]))
    with pytest.raises(FemtuneError, match=r"4 eigenvalues .*2\.5 rad²/s².* 3 ") as missed:
        eigen_slepc.solve_by_slepc(K, M, 3, None, _end)
    assert missed.value.code == "eigen.missed-modes"
    assert eigen_slepc.solve_by_slepc(K, M, None, 1.0, _end).wanted == 4
    spoiled = _modes([0.0, 1.0, 2.0, 3.0], [1e-12, 1e-3, 1e-12, 1e-12])
    monkeypatch.setattr(eigen_slepc, "slepc_lowest", lambda K, M, count: spoiled)
    with pytest.raises(FemtuneError, match="mode 2 ") as inaccurate:
        eigen_slepc.solve_by_slepc(K, M, 3, None, _end)
    assert inaccurate.value.code == "eigen.inaccurate"
    monkeypatch.setattr(eigen_slepc, "slepc_lowest", lambda K, M, count: _modes([0.0, 1.0, 2.0, 3.0]))
    with pytest.raises(FemtuneError, match=r"mode 5 .* did not converge"):
        eigen_slepc.solve_by_slepc(K, M, 5, None, _end)
    negative = SymmetricMatrix(-K.data, K.indices, K.indptr)
    monkeypatch.setattr(eigen_slepc, "slepc_lowest", lambda K, M, count: _modes([-2.0, 1.0, 2.0, 3.0]))
    with pytest.raises(FemtuneError, match="negative strain energy") as refused:
        eigen_slepc.solve_by_slepc(negative, M, 4, None, _end)
    assert refused.value.code == "eigen.negative"
