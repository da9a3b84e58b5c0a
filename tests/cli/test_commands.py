"""Commands, their output and exit codes."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import Result

import femtune
from femtune.errors import Notice
from femtune.journal.journal import from_journal
from femtune.steps.exit_codes import exit_code_table
from femtune.steps.judge.record.judgement import JudgementResults
from femtune.steps.judge.record.reason import ReasonRecord

Invoke = Callable[..., Result]

_COMMANDS = [
    "init",
    "check",
    "schema",
    "info",
    "modes",
    "view",
    "compare",
    "respond",
    "plan",
    "identify",
    "correlate",
    "select",
    "quantify",
    "intervals",
    "update",
    "screen",
    "search",
    "candidates",
    "bootstrap",
    "posterior",
    "validate",
    "run",
    "report",
    "explain",
]


def test_help_lists_the_commands_in_the_order_of_the_steps(invoke: Invoke, command_names: list[str]) -> None:
    result = invoke("--help")
    assert result.exit_code == 0
    assert sorted(command_names) == sorted(_COMMANDS)
    places = [result.output.index(f"\n  {name}") for name in command_names]
    assert places == sorted(places)


def test_help_has_groups_and_fits_a_terminal(invoke: Invoke) -> None:
    lines = invoke("--help").output.splitlines()
    headings = [line for line in lines if line.endswith(":") and not line.startswith(" ")]
    assert headings[:3] == ["Options:", "First steps:", "Model:"]
    assert headings[-1] == "Help:"
    assert lines[lines.index("First steps:") + 1].startswith("  init ")
    assert max(map(len, lines)) <= 80


def test_the_study_of_the_folder_is_taken(invoke: Invoke, steps: Any, study: Path) -> None:
    assert invoke("run").stdout == invoke("run", study.name).stdout
    study.unlink()
    for command in ("run", "check", "report"):
        refused = invoke(command)
        assert refused.exit_code == 2
        assert "has no study.toml; `femtune init DECK TEST` writes one" in refused.stderr


@pytest.mark.parametrize("command", _COMMANDS)
def test_every_command_has_help(invoke: Invoke, command: str) -> None:
    result = invoke(command, "-h")
    assert result.exit_code == 0
    assert f"femtune {command}" in result.output.replace("main", "femtune")


def test_version(invoke: Invoke) -> None:
    assert invoke("--version").output == f"femtune, version {femtune.__version__}\n"


def test_help_imports_no_numerics() -> None:
    code = "import sys, femtune.cli; print([m for m in ('numpy', 'scipy', 'pydantic', 'rich') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.parametrize("command", ["info", "modes", "correlate", "select"])
def test_json_is_the_result_and_nothing_else(invoke: Invoke, steps: Any, study: Path, command: str) -> None:
    result = invoke(command, study, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout) == {"name": "CBAR", "count": 7}
    assert [(name, path) for name, path, _ in steps.calls] == [(command, study)]


def test_result_is_shown(invoke: Invoke, steps: Any, study: Path) -> None:
    assert "CBAR" in invoke("info", study).stdout
    assert invoke("info", study, "--quiet").stdout == ""


@pytest.mark.slow
def test_solvers_need_no_study(invoke: Invoke) -> None:
    result = invoke("info", "--solvers")
    assert result.exit_code == 0
    assert "SuperLU" in result.output


def test_info_without_anything(invoke: Invoke) -> None:
    result = invoke("info")
    assert result.exit_code == 2
    assert "give a study or a deck" in result.output


def test_run_ends_by_naming_the_report(invoke: Invoke, steps: Any, study: Path) -> None:
    result = invoke("run", study)
    assert result.exit_code == 0
    assert result.stdout.splitlines()[-1] == f"report: {study.parent / 'run' / 'report.html'}"
    assert steps.calls == [("run", study, {"output": None, "wide": None})]


def test_options_reach_the_step(invoke: Invoke, steps: Any, study: Path, tmp_path: Path) -> None:
    result = invoke("update", study, "--output", tmp_path / "other", "--wide")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[-1] == f"results: {tmp_path / 'other'}"
    assert steps.calls == [("update", study, {"output": tmp_path / "other", "wide": True})]


def test_update_without_an_optimum_ends_with_code_1(invoke: Invoke, steps: Any, study: Path) -> None:
    steps.outcome = SimpleNamespace(ok=False, status="STALLED", message="no step lowers the objective")
    result = invoke("update", study, "--quiet")
    assert result.exit_code == 1
    assert "STALLED: no step lowers the objective" in result.stderr
    assert (study.parent / "run" / "results.json").exists()


def test_update_with_an_optimum_ends_with_code_0(invoke: Invoke, steps: Any, study: Path) -> None:
    steps.outcome = SimpleNamespace(ok=True, status="CONVERGED", message="")
    steps.judgement = JudgementResults(verdict="not accepted", line="Not accepted: it is wrong.")
    assert invoke("update", study, "--quiet").exit_code == 0


_VERDICTS = [("accepted", 0, 0), ("accepted with reservations", 0, 3), ("not accepted", 4, 4)]


@pytest.mark.parametrize("command", ["run", "validate", "correlate"])
@pytest.mark.parametrize(("verdict", "code", "strict"), _VERDICTS)
def test_the_verdict_is_the_exit_code(
    invoke: Invoke, steps: Any, study: Path, command: str, verdict: Any, code: int, strict: int
) -> None:
    weight: Any = "not accepted" if code else "reservation"
    why = ReasonRecord(code="judge.mesh", weight=weight, sentence="the mesh is too coarse " * 4, place="wing")
    reasons = () if verdict == "accepted" else (why,)
    steps.judgement = JudgementResults(verdict=verdict, line=f"{verdict.capitalize()}: words.", reasons=reasons)
    for options, expected in (((), code), (("--strict",), strict)):
        result = invoke(command, study, "--quiet", *options)
        assert result.exit_code == expected
        assert result.stderr.startswith(f"{verdict.capitalize()}: words.\n")
        assert ("[judge.mesh] the mesh" in result.stderr and "(wing)" in result.stderr) == bool(reasons)
        assert max(map(len, result.stderr.splitlines())) <= 80


def test_exit_codes_are_listed_in_help_and_guide(invoke: Invoke) -> None:
    shown = invoke("--help").stdout
    page = (Path(__file__).parents[2] / "docs" / "guide" / "verdict.md").read_text(encoding="utf-8")
    assert exit_code_table() in page
    for code in (0, 1, 2, 3, 4, 70, 130, 143):
        assert re.search(rf"^ +{code}  ", shown, re.MULTILINE)


def test_report_takes_a_run_folder(invoke: Invoke, steps: Any, tmp_path: Path) -> None:
    assert invoke("report", tmp_path).stdout == f"report: {tmp_path / 'report.html'}\n"


_OF_A_STUDY = [c for c in _COMMANDS if c not in ("compare", "report", "explain", "init", "check", "schema")]


def test_check_of_a_missing_study(invoke: Invoke, tmp_path: Path) -> None:
    result = invoke("check", tmp_path / "none.toml")
    assert result.exit_code == 2
    assert "[study.missing-file] the file does not exist" in result.output


@pytest.mark.parametrize("command", _OF_A_STUDY)
def test_missing_study(invoke: Invoke, steps: Any, tmp_path: Path, command: str) -> None:
    result = invoke(command, tmp_path / "none.toml")
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("[study.missing-file] the file does not exist\n")
    assert "Traceback" not in result.output


def test_misspelt_key(invoke: Invoke, steps: Any, study: Path) -> None:
    study.write_text(study.read_text() + "[modes]\ncuont = 3\n")
    result = invoke("run", study)
    assert result.exit_code == 2
    assert "[study.unknown-key] 'cuont'" in result.stderr
    assert "study.toml:6 (modes.cuont)" in result.stderr
    assert "hint: did you mean 'count'?" in result.stderr


def test_unwritable_folder(invoke: Invoke, steps: Any, study: Path) -> None:
    (study.parent / "file").touch()
    result = invoke("run", study, "--output", study.parent / "file" / "run")
    assert result.exit_code == 2
    assert result.stderr.startswith("[run.unwritable]")


def test_unknown_command_and_option(invoke: Invoke, study: Path) -> None:
    assert invoke("tune", study).exit_code == 2
    assert invoke("run", study, "--fast").exit_code == 2


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, femtune.cli.commands; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert "click" in loaded
    assert not loaded & {"numpy", "scipy", "pydantic", "matplotlib", "rich", "jinja2", "pyuff"}


@pytest.mark.parametrize("name", ["modes", "correlate", "select"])
def test_what_came_from_the_journal_is_said_beside_the_result(
    invoke: Invoke, steps: Any, study: Path, name: str
) -> None:
    asked: list[bool] = []
    given = getattr(steps, name)

    def step(path: Path, fresh: bool, **options: Any) -> Any:
        asked.append(fresh)
        return SimpleNamespace(
            **{**vars(given(path, **options)), "remarks": (Notice("", "12 of 30 \x1b solutions", level="info"),)}
        )

    setattr(steps, name, step)
    result = invoke(name, study, "--json")
    verdict = f"{steps.judgement.line}\n" if name == "correlate" else ""
    assert result.stderr == f"12 of 30 \\x1b solutions\n{verdict}"
    assert result.stdout.startswith("{")
    assert invoke(name, study, "--quiet", "--fresh").stderr == verdict
    assert asked == [False, True]


@pytest.mark.parametrize("name", ["run", "update"])
def test_a_run_says_what_came_from_the_journal(invoke: Invoke, steps: Any, study: Path, name: str) -> None:
    given = getattr(steps, name)

    def step(path: Path, **options: Any) -> Any:
        found = given(path, **options)
        return SimpleNamespace(**{**vars(found), "remarks": () if options["fresh"] else from_journal(12, 18)})

    setattr(steps, name, step)
    verdict = f"{steps.judgement.line}\n" if name == "run" else ""
    assert invoke(name, study).stderr == f"12 of 30 solutions from the journal of an earlier run\n{verdict}"
    assert invoke(name, study, "--quiet").stderr == verdict
    assert invoke(name, study, "--fresh").stderr == verdict
    assert [options.get("fresh", False) for *_, options in steps.calls] == [False, False, True]


@pytest.mark.parametrize("options", [(), ("--json",), ("--quiet", "--fresh")])
def test_modes_on_a_page(invoke: Invoke, steps: Any, study: Path, options: tuple[str, ...]) -> None:
    """The page is named where it disturbs nothing: after the JSON on standard error."""
    asked: list[tuple[Path, bool]] = []
    given = steps.modes

    def modes(path: Path, report: Path, fresh: bool, **limits: Any) -> Any:
        assert limits.keys() == {"count", "max_hz", "simulate", "vtu", "progress"}
        asked.append((report, fresh))
        return given(path, **limits)

    steps.modes = modes
    result = invoke("modes", study, "--report", "page.html", *options)
    assert result.exit_code == 0
    assert asked == [(Path("page.html"), "--fresh" in options)]
    line = f"report: {study.parent / 'page.html'}"
    assert (result.stderr if "--json" in options else result.stdout).splitlines()[-1] == line
    if "--json" in options:
        assert json.loads(result.stdout) == {"name": "CBAR", "count": 7}


def test_modes_on_a_page_that_cannot_be_written(invoke: Invoke, study: Path) -> None:
    result = invoke("modes", study, "--report", study.parent)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("[run.unwritable] the report cannot be written: Is a directory\n")
    assert "Traceback" not in result.output


@pytest.mark.slow
def test_solvers_as_data(invoke: Invoke) -> None:
    result = invoke("info", "--solvers", "--json")
    assert result.exit_code == 0
    names = [facts["name"] for facts in json.loads(result.stdout)]
    assert names == ["PARDISO", "MUMPS", "CHOLMOD", "RSLAB", "SuperLU", "SLEPc"]


@pytest.mark.parametrize("before", [None, "own"])
def test_the_eigen_solver_is_chosen_for_one_command(
    before: str | None, invoke: Invoke, steps: Any, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    monkeypatch.delenv("FEMTUNE_EIGENSOLVER", raising=False)
    if before is not None:
        monkeypatch.setenv("FEMTUNE_EIGENSOLVER", before)
    step = steps.modes
    monkeypatch.setattr(steps, "modes", lambda *a, **k: seen.append(os.environ["FEMTUNE_EIGENSOLVER"]) or step(*a, **k))
    assert invoke("modes", study, "--eigensolver", "slepc").exit_code == 0
    assert seen == ["slepc"]
    assert os.environ.get("FEMTUNE_EIGENSOLVER") == before
    assert invoke("modes", study, "--eigensolver", "hal").exit_code == 2


@pytest.mark.parametrize("code", ["units.unknown", "[units.unknown]"])
def test_a_code_is_explained_with_its_fix(invoke: Invoke, code: str) -> None:
    result = invoke("explain", code)
    assert result.exit_code == 0
    explained, _, fix = result.stdout.partition("To fix it: ")
    assert explained.startswith("[units.unknown]\n\nA deck has no units")
    assert 'units = "m-kg-s"' in fix


@pytest.mark.parametrize(
    ("code", "hint"),
    [("units.unknwon", "did you mean 'units.unknown'?"), ("../errors", "deck.missing-include"), ("", "have the form")],
)
def test_an_unknown_code_is_told(invoke: Invoke, code: str, hint: str) -> None:
    result = invoke("explain", code)
    assert result.exit_code == 2
    assert hint in " ".join(result.stderr.split())
