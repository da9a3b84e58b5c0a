"""What is said after Ctrl-C amid imports, when no further module can be loaded."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from femtune.cli.guard import Running


def test_nothing_is_imported_to_find_the_run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "femtune.files.study_file", raising=False)
    assert Running(tmp_path / "study.toml").written() == []
    assert "femtune.files.study_file" not in sys.modules
