"""Free memory from the kernel's files, and the refusal of work that does not fit."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from femtune.cli.guard import GuardedGroup
from femtune.errors import FemtuneError
from femtune.model.linear import memory
from femtune.model.linear.memory import free_memory, require_memory
from femtune.model.linear.symmetric import SymmetricMatrix
from femtune.model.solvers import mumps, pardiso
from femtune.model.solvers.interface import SingularMatrixError


def _write(root: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


MACHINE = {"proc/meminfo": "MemTotal:  8000 kB\nMemFree:  100 kB\nMemAvailable:  4000 kB\n"}


def test_the_machine_alone(tmp_path: Path) -> None:
    assert free_memory(_write(tmp_path, MACHINE)) == 4000 * 1024


def test_nobody_says(tmp_path: Path) -> None:
    assert free_memory(tmp_path) is None


def test_the_tightest_group_of_version_2_counts(tmp_path: Path) -> None:
    files = MACHINE | {
        "proc/self/cgroup": "0::/job/step\n",
        "sys/fs/cgroup/job/step/memory.max": "max\n",
        "sys/fs/cgroup/job/step/memory.current": "900000\n",
        "sys/fs/cgroup/job/memory.max": "2000000\n",
        "sys/fs/cgroup/job/memory.current": "1500000\n",
        "sys/fs/cgroup/job/memory.stat": "anon 1\nactive_file 7\ninactive_file 300000\n",
    }
    assert free_memory(_write(tmp_path, files)) == 2000000 - 1500000 + 300000


def test_groups_of_version_1_seen_from_within_a_container(tmp_path: Path) -> None:
    files = MACHINE | {
        "proc/self/cgroup": "5:cpu:/elsewhere\n4:memory:/elsewhere/far\n0::/\n",
        "sys/fs/cgroup/memory/memory.limit_in_bytes": "1000000\n",
        "sys/fs/cgroup/memory/memory.usage_in_bytes": "400000\n",
        "sys/fs/cgroup/memory/memory.stat": "inactive_file 5\ntotal_inactive_file 50000\n",
    }
    assert free_memory(_write(tmp_path, files)) == 650000


def test_a_group_that_is_over_its_limit_leaves_nothing(tmp_path: Path) -> None:
    files = {
        "proc/self/cgroup": "0::/\n",
        "sys/fs/cgroup/memory.max": "10\n",
        "sys/fs/cgroup/memory.current": "20\n",
    }
    assert free_memory(_write(tmp_path, files)) == 0


@pytest.mark.skipif(not Path("/proc/meminfo").exists(), reason="the kernel has no /proc/meminfo")
def test_this_machine() -> None:
    free = free_memory()
    assert free is not None
    assert 0 < free <= os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def test_what_fits_passes_and_what_does_not_says_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 2 * 1024**3)
    require_memory(2 * 1024**3, "model.memory/assembling", dofs=600_000)
    with pytest.raises(FemtuneError) as error:
        require_memory(3 * 1024**3, "model.memory/assembling", dofs=600_000)
    assert error.value.code == "model.memory"
    assert "600,000 DOFs" in error.value.what
    assert error.value.hint
    assert error.value.values == {"needed_bytes": 3 * 1024**3, "free_bytes": 2 * 1024**3}


def test_small_work_is_not_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 0)
    require_memory(memory.NEGLIGIBLE_BYTES - 1, "model.memory/assembling", dofs=24)
    with pytest.raises(FemtuneError, match="memory"):
        require_memory(memory.NEGLIGIBLE_BYTES, "model.memory/assembling", dofs=24_000)


_LIMITED = """
import resource
from femtune.model.linear.memory import free_memory, require_memory
before = free_memory()
taken = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + (50 << 20), -1))
print(free_memory(), before)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the size of the process is read from /proc")
def test_the_limit_of_addresses_counts() -> None:
    said = subprocess.run([sys.executable, "-c", _LIMITED], capture_output=True, text=True, check=True).stdout
    free, before = map(int, said.split())
    assert 40 << 20 < free <= 50 << 20 < before


def test_memory_that_a_library_lacks_is_told_with_sizes() -> None:
    matrix = SymmetricMatrix(np.ones(3), np.arange(3), np.arange(4))
    for error in (pardiso.failure(-2, 200_000, 9_000_000, 3 << 30), mumps.failure(-13, matrix)):
        assert isinstance(error, FemtuneError)
        assert error.code == "model.memory"
        assert error.values["needed_bytes"] > 0
        assert "free_bytes" in error.values
    assert "200,000 equations" in str(pardiso.failure(-2, 200_000, 9_000_000, 3 << 30))
    assert "3 GiB" in str(pardiso.failure(-2, 200_000, 9_000_000, 3 << 30))
    assert isinstance(pardiso.failure(-4, 9, 9, 9), SingularMatrixError)


def test_the_command_line_tells_of_memory_and_of_no_fault() -> None:
    @click.group(cls=GuardedGroup)
    def group() -> None:
        pass

    @group.command()
    def large() -> None:
        raise MemoryError("Unable to allocate 7.45 GiB for an array with shape (1000000000,)")

    done = CliRunner().invoke(group, ["large"])
    assert done.exit_code == 2
    assert "[model.memory] memory ran out: Unable to allocate 7.45 GiB" in done.output
    assert "free_bytes" in done.output
