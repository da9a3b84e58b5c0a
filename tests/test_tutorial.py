"""docs/tutorial.md: its code and its commands run as written, and what they print is what the page shows."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import femtune as ft
from femtune.cli import main

_PAGE = (Path(__file__).resolve().parents[1] / "docs" / "tutorial.md").read_text(encoding="utf-8")


def _run(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as end:
        main(shlex.split(command))
    # the verdict on the run is that of the page: its mesh is too coarse
    assert end.value.code == (4 if command.startswith("run ") else 0), command
    return capsys.readouterr().out


def _numbers(text: str) -> list[str]:
    return re.findall(r"\d+\.\d+", text)


@pytest.mark.slow
def test_the_tutorial_as_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", _PAGE, re.S)
    exec(compile(code, "plate.py", "exec"), {})
    commands = [c for block in re.findall(r"```\n(femtune.*?)```", _PAGE, re.S) for c in block.splitlines()]
    assert [c.split()[1] for c in commands] == ["modes", "init", "check", "run"]
    printed = [_run(c.removeprefix("femtune "), capsys) for c in commands]
    shown = re.findall(r"```text\n(.*?)```", _PAGE, re.S)
    assert len(shown) == 3
    assert shown[2].strip() in printed[3].splitlines()
    for text, output in zip(shown[:2], (printed[1], printed[3]), strict=True):
        missing = [n for n in _numbers(text) if n not in _numbers(output)]
        assert not missing, output

    # the last advice of step 4
    study = tmp_path / "study.toml"
    first = ft.read_results(tmp_path / "run").parameters
    text = study.read_text(encoding="utf-8")
    text = text.replace("frequency_sd = 0.005 ", "frequency_sd = 0.002 ").replace(
        "shape_sd = 0.03 ", "shape_sd = 0.01 "
    )
    study.write_text(text.replace('assumed = ["frequency_sd", "shape_sd"]', ""))
    _run("run study.toml", capsys)
    second = ft.read_results(tmp_path / "run").parameters
    true = {"T_PSHELL_1": 4.9 / 5.0, "T_PSHELL_2": 7.2 / 8.0}
    for wide, narrow in zip(first, second, strict=True):
        assert wide["sd"] == pytest.approx(2.72 * narrow["sd"], rel=0.05)
        for row in (wide, narrow):
            assert row["interval_95_lower"] < true[row["name"]] < row["interval_95_upper"]
