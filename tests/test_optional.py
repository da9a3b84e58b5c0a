"""Optional libraries: missing and broken are different errors, each with its pip line."""

from __future__ import annotations

from pathlib import Path

import pytest

from femtune._optional import require
from femtune.errors import FemtuneError


def test_what_is_there_is_imported() -> None:
    assert require("json.decoder").__name__ == "json.decoder"


def test_missing_names_the_extra() -> None:
    with pytest.raises(FemtuneError, match="not installed") as caught:
        require("no_such_library_at_all", extra="fast")
    assert caught.value.code == "install.missing"
    assert caught.value.hint == 'pip install "femtune[fast]"'


def test_broken_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a_broken_library.py").write_text("raise OSError('libfoo.so: cannot open')\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(FemtuneError, match=r"libfoo\.so") as caught:
        require("a_broken_library")
    assert caught.value.code == "install.broken"
