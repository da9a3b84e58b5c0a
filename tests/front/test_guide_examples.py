"""The examples of the guide pages on Python that need no files of a user run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

GUIDE = Path(__file__).parents[2] / "docs" / "guide"
RESEARCHERS = (GUIDE / "researchers.md").read_text()


def blocks(text: str, language: str = "python") -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)


COMPLETE = {
    f"{page} {i}": code
    for page in ("python", "researchers")
    for i, code in enumerate(blocks((GUIDE / f"{page}.md").read_text()))
    if "frame.bdf" not in code
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMPLETE)
def test_the_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(COMPLETE[name], name, "exec"), {"__name__": "__main__"})


def test_from_matrices_to_a_parameter_in_twelve_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code = blocks(RESEARCHERS)[0]
    assert len([line for line in code.splitlines() if line.strip()]) <= 12
    exec(compile(code, "researchers.md", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out == blocks(RESEARCHERS, "text")[0]
