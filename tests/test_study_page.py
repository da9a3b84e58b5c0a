"""The pages about the study file: their examples are studies."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from femtune.files.study_file.reading import study_from_text

_ROOT = Path(__file__).resolve().parents[1]
_PAGE = (_ROOT / "docs" / "study-file.md").read_text(encoding="utf-8")
_README = (_ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("text", [_PAGE, _README], ids=["study-file.md", "README.md"])
def test_the_example_is_a_study(text: str, tmp_path: Path) -> None:
    examples = re.findall(r"```toml\n(.*?)```", text, re.S)
    assert examples
    for name in ("building.bdf", "building.uff"):
        (tmp_path / name).touch()
    study = study_from_text(examples[0], tmp_path / "study.toml")
    assert [p.name for p in study.parameter] == ["Ibx1", "Ibx2"]
