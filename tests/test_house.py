"""Habits of the house that no linter knows: sizes, names, and words that have no place in the code."""

from __future__ import annotations

import ast
import re
import statistics
from collections.abc import Iterator
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_MODULES = sorted((_ROOT / "src").rglob("*.py"))
_NO_NAMES = {"utils", "util", "helpers", "helper", "misc", "common", "tools", "functions"}
_NO_WORDS = re.compile(r"\b(TODO|FIXME|XXX|raise NotImplementedError|pickle|eval\(|exec\()")


def _ids(path: Path) -> str:
    return str(path.relative_to(_ROOT / "src"))


def _functions(path: Path) -> Iterator[ast.FunctionDef]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    yield from (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def _body_lines(function: ast.FunctionDef) -> int:
    """Lines from the first statement after the docstring to the last."""
    first = function.body[1:] if ast.get_docstring(function) is not None else function.body
    return (function.end_lineno or 0) - first[0].lineno + 1 if first else 0


@pytest.mark.parametrize("path", _MODULES, ids=_ids)
def test_a_file_is_short_and_says_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 400
    assert ast.get_docstring(ast.parse(text))


@pytest.mark.parametrize("path", _MODULES, ids=_ids)
def test_a_function_is_shorter_than_thirty_lines(path: Path) -> None:
    assert [f"{f.name}: {_body_lines(f)}" for f in _functions(path) if _body_lines(f) > 30] == []


def test_half_of_all_functions_have_ten_lines_or_fewer() -> None:
    assert statistics.median(_body_lines(f) for path in _MODULES for f in _functions(path)) <= 10


def test_no_drawer_for_odds_and_ends() -> None:
    names = {part for path in _MODULES for part in path.relative_to(_ROOT / "src").with_suffix("").parts}
    assert not names & _NO_NAMES


@pytest.mark.parametrize("path", _MODULES, ids=_ids)
def test_no_unfinished_work_and_nothing_that_executes_text(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    assert [line.strip() for line in lines if _NO_WORDS.search(line)] == []
