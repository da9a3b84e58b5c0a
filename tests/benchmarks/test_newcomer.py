"""The benchmark of first users: three commands of the README, or at most twelve lines, lead to a result."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from tests.loaded import load_module

_SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "newcomer" / "run.py"


@pytest.fixture(scope="module")
def run() -> ModuleType:
    return load_module(_SCRIPT, "newcomer_run")


def test_the_readme_leads_to_a_report_in_three_commands(run: ModuleType) -> None:
    assert [command.split()[1] for command in run.first_commands()] == ["init", "check", "run"]


def test_matrices_lead_to_parameters_in_at_most_twelve_lines(run: ModuleType) -> None:
    lines = [line for line in run.researchers_script().splitlines() if line.strip()]
    assert 5 < len(lines) <= 12


@pytest.mark.slow
@pytest.mark.parametrize("task", ["own_report", "from_matrices"])
def test_a_task_ends_with_its_result(run: ModuleType, task: str, tmp_path: Path) -> None:
    done = getattr(run, task)(tmp_path)
    assert done.clock > 0.0
    assert done.left
    assert f"| {done.title} |" in run.page([done])


@pytest.mark.slow
def test_a_task_that_fails_is_told(run: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "researchers_script", lambda: "import sys; sys.exit(1)")
    with pytest.raises(RuntimeError, match="ended with 1"):
        run.from_matrices(tmp_path)
