"""The examples of the guide page on Python that need no files of a user run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "guide" / "python.md"
COMPLETE = [code for code in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.S) if "frame.bdf" not in code]


@pytest.mark.slow
@pytest.mark.parametrize("code", COMPLETE, ids=["matrices", "own residual"])
def test_the_example_runs(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(code, str(PAGE), "exec"), {"__name__": "__main__"})
