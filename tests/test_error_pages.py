"""Every code of an error or notice has a page in docs/errors, and every page has a code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_CODE = re.compile(r"[a-z][a-z0-9]*\.[a-z][a-z0-9]*(-[a-z0-9]+)*")
_RAISERS = ("FemtuneError", "Notice")
# area.problem looks like file.suffix: these are files
_SUFFIXES = ("json", "npz", "npy", "bdf", "html", "toml", "csv", "md", "txt", "css", "uff", "bib", "log", "js")


def _trees() -> Iterator[ast.Module]:
    for path in sorted((_ROOT / "src").rglob("*.py")):
        yield ast.parse(path.read_text(encoding="utf-8"))


def _code_argument(call: ast.Call) -> ast.expr | None:
    named = [k.value for k in call.keywords if k.arg == "code"]
    return next(iter([*call.args[:1], *named]), None)


def _raised() -> list[ast.expr]:
    """The code argument of each direct call of FemtuneError or Notice."""
    calls = (node for tree in _trees() for node in ast.walk(tree) if isinstance(node, ast.Call))
    direct = (c for c in calls if isinstance(c.func, ast.Name) and c.func.id in _RAISERS)
    return [argument for c in direct if (argument := _code_argument(c)) is not None]


@lru_cache
def _codes() -> frozenset[str]:
    """Codes given to FemtuneError or Notice, and all other constants of the same areas that look like one."""
    constants = {
        node.value
        for tree in _trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and _CODE.fullmatch(node.value)
    }
    areas = {a.value.split(".")[0] for a in _raised() if isinstance(a, ast.Constant)} | {
        p.split(".")[0] for p in _pages()
    }
    return frozenset(c for c in constants if c.split(".")[0] in areas and c.split(".")[1] not in _SUFFIXES)


def _pages() -> set[str]:
    return {p.stem for p in (_ROOT / "docs" / "errors").glob("*.md")} - {"index"}


def test_the_scan_finds_codes() -> None:
    assert {"dof.syntax", "tie.value", "parameter.bounds", "install.missing"} <= _codes()


def test_codes_are_written_out() -> None:
    """A code that is put together while running could not be looked up."""
    assert not [ast.unparse(a) for a in _raised() if isinstance(a, ast.JoinedStr | ast.BinOp)]


def test_codes_are_area_and_problem() -> None:
    given = [a.value for a in _raised() if isinstance(a, ast.Constant)]
    assert not [code for code in given if not _CODE.fullmatch(str(code))]


def test_each_code_has_a_page() -> None:
    assert sorted(_codes() - _pages()) == []


def test_each_page_has_a_code() -> None:
    assert sorted(_pages() - _codes()) == []


@pytest.mark.parametrize("code", sorted(_pages()))
def test_a_page_is_headed_by_its_code_and_shows_a_message(code: str) -> None:
    text = (_ROOT / "docs" / "errors" / f"{code}.md").read_text(encoding="utf-8")
    assert text.startswith(f"# `{code}`\n")
    assert f"[{code}]" in text
    assert len(text.splitlines()) >= 8
