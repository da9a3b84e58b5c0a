"""The recipes of CONTRIBUTING are followed on a copy of the program.

A recipe is a folder beside this file: ``edits.toml`` has texts of the program and what replaces them, ``new`` the files
that it adds, and ``check.py`` shows in a process of its own that the changed program does what was wanted.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]
_RECIPES = Path(__file__).parent


@dataclass(frozen=True)
class Size:
    """How much a recipe may touch: files of the program, and lines that are added in all."""

    files: int
    lines: int


_SIZES = {
    "card": Size(2, 50),
    "residual": Size(2, 60),
    "reader": Size(2, 60),
    "key": Size(2, 10),
    "kind": Size(2, 30),
    "command": Size(1, 10),
    "step": Size(8, 250),
}


def _followed(name: str, package: Path) -> tuple[set[str], int]:
    """Follow a recipe in a copy of the package; the files that it touches, and the number of lines that it adds."""
    recipe = _RECIPES / name
    touched, lines = set[str](), 0
    for edit in tomllib.loads((recipe / "edits.toml").read_text(encoding="utf-8"))["edit"]:
        file = package / edit["file"]
        text = file.read_text(encoding="utf-8")
        assert text.count(edit["replace"]) == 1, edit
        file.write_text(text.replace(edit["replace"], edit["by"]), encoding="utf-8")
        touched.add(edit["file"])
        lines += edit["by"].count("\n") - edit["replace"].count("\n")
    for source in sorted((recipe / "new").rglob("*.*")):
        target = package / source.relative_to(recipe / "new")
        assert not target.exists()
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, target)
        touched.add(target.relative_to(package).as_posix())
        lines += source.read_text(encoding="utf-8").count("\n")
    return touched, lines


def _paragraph(name: str) -> str:
    """The recipe in CONTRIBUTING."""
    found = re.search(rf"^- \*A {name}\b.*?(?=^- |^$)", (_ROOT / "CONTRIBUTING.md").read_text(), re.M | re.S)
    assert found is not None
    return found[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", _SIZES)
def test_a_recipe_does_what_it_says(name: str, tmp_path: Path) -> None:
    package = tmp_path / "src" / "femtune"
    # with the compiled modules, whose time stamps stay valid
    shutil.copytree(_ROOT / "src" / "femtune", package)
    touched, lines = _followed(name, package)
    assert len(touched) <= _SIZES[name].files
    assert lines <= _SIZES[name].lines
    environment = {**os.environ, "PYTHONPATH": str(package.parent), "OMP_NUM_THREADS": "1"}
    work = tmp_path / "work"
    work.mkdir()
    check = [sys.executable, "-W", "error", str(_RECIPES / name / "check.py"), str(package)]
    done = subprocess.run(check, cwd=work, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", _SIZES)
def test_contributing_names_the_files_that_a_recipe_edits(name: str) -> None:
    edits = tomllib.loads((_RECIPES / name / "edits.toml").read_text(encoding="utf-8"))["edit"]
    text = _paragraph(name)
    assert [edit["file"] for edit in edits if f"`{edit['file']}`" not in text] == []


def test_every_recipe_is_followed() -> None:
    assert {path.parent.name for path in _RECIPES.glob("*/check.py")} == set(_SIZES)
