"""Messages about SLEPc's processes: each is the example that its page shows."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import scipy.sparse as sp
from tests.messages.shown import check_shown

from femtune.errors import FemtuneError
from femtune.model.distributed import exchange, launch, processes
from femtune.model.eigen.slepc import small_for_slepc
from femtune.model.linear.symmetric import symmetric

_SAID = """Traceback (most recent call last):
petsc4py.PETSc.Error: error code 76
MUMPS error in numerical factorization phase: INFOG(1)=-9, INFO(2)=4711

------------------------------------------------------------------------------
Primary job terminated normally, but 1 process returned a non-zero exit code.
"""


@pytest.fixture(autouse=True)
def settings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(launch.PYTHON, "/opt/petsc/bin/python")
    monkeypatch.setenv(launch.LAUNCHER, "srum -n 64")
    monkeypatch.setattr(exchange.shutil, "disk_usage", lambda path: type("Usage", (), {"free": 98_000_000}))


def failed_run(folder: Path) -> None:
    (folder / "said.txt").write_text(_SAID.partition("\n")[2], encoding="utf-8")
    command = ["mpiexec", "-n", "2", "/usr/bin/python3", "program.py", "/tmp/femtune-slepc-1"]
    raise launch.failed_run(command, 3, folder / "said.txt")


def _short(folder: Path) -> None:
    raise exchange.no_result("slepc.no-result/number-of-rows", rows=8, dofs=9)


def _late(folder: Path) -> None:
    command = ["srun", "-n", "64", "/usr/bin/python3", "program.py", "/tmp/femtune-slepc-1"]
    raise processes.timeout(command, 600.0)


def test_notice_of_a_small_model_is_the_example_of_its_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FEMTUNE_EIGENSOLVER", "slepc")
    (notice,) = small_for_slepc(symmetric(sp.eye_array(9)))
    check_shown("slepc.not-used", notice)


CASES: dict[str, Callable[[Path], object]] = {
    "slepc.not-installed": lambda folder: launch.slepc_python(),
    "slepc.launcher": lambda folder: launch.launcher(64),
    "slepc.failed": failed_run,
    "slepc.timeout": _late,
    "slepc.files": lambda folder: exchange.check_room(Path("/scratch/femtune-slepc-1"), 412_000_000),
    "slepc.no-result": _short,
}


@pytest.mark.parametrize("code", CASES)
def test_message_is_the_example_of_its_page(code: str, tmp_path: Path) -> None:
    with pytest.raises(FemtuneError) as caught:
        CASES[code](tmp_path)
    assert caught.value.code == code
    check_shown(code, str(caught.value))
