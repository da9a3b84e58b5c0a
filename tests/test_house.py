"""Habits of the house that no linter knows: names, and words that have no place in the code.

Complexity (paths, branches, nested blocks) is bounded by the linter, see pyproject.toml; length is not.
"""

from __future__ import annotations

import ast
import re
import string
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[1]
_MODULES = sorted((_ROOT / "src").rglob("*.py"))
_FRONT_DOOR = {
    *(f"files/study_file/{name}.py" for name in ("objects", "parameter", "residual")),
    "study/described.py",
}
"""Tables of a study as Python objects: they have the words of the file, as what is made of them on other floors has."""
_NO_NAMES = {"utils", "util", "helpers", "helper", "misc", "common", "tools", "functions"}
_NO_WORDS = re.compile(r"\b(TODO|FIXME|XXX|raise NotImplementedError|pickle|eval\(|exec\()")


@cache
def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_file_says_what_it_is() -> None:
    assert [str(path) for path in _MODULES if not ast.get_docstring(_tree(path))] == []


@pytest.mark.slow
def test_a_class_has_a_name_of_its_own() -> None:
    modules = [path for path in _MODULES if path.relative_to(_ROOT / "src/femtune").as_posix() not in _FRONT_DOOR]
    nodes = (node for path in modules for node in ast.walk(_tree(path)))
    names = Counter(node.name for node in nodes if isinstance(node, ast.ClassDef) and not node.name.startswith("_"))
    assert [name for name, times in names.items() if times > 1] == []


def test_no_drawer_for_odds_and_ends() -> None:
    names = {part for path in _MODULES for part in path.relative_to(_ROOT / "src").with_suffix("").parts}
    assert not names & _NO_NAMES


def test_no_unfinished_work_and_nothing_that_executes_text() -> None:
    # between processes that femtune itself has started; files are never unpickled
    pipes = {"executor/cluster.py", "executor/processes.py", "executor/worker.py"}
    modules = [path for path in _MODULES if path.relative_to(_ROOT / "src/femtune").as_posix() not in pipes]
    lines = ((path, line) for path in modules for line in path.read_text(encoding="utf-8").splitlines())
    assert [f"{path}: {line.strip()}" for path, line in lines if _NO_WORDS.search(line)] == []


_CODE = re.compile(r"[a-z][a-z0-9]*\.[a-z][a-z0-9-]*(/[a-z0-9-]+)?")
_OF_ERRORS = {"where", "values", "hint", "level"}
# area.problem looks like file.suffix: these are files
_SUFFIXES = (
    "json",
    "npz",
    "npy",
    "bdf",
    "html",
    "toml",
    "csv",
    "md",
    "txt",
    "css",
    "uff",
    "bib",
    "log",
    "js",
    "py",
    "sqlite",
)


def _messages() -> dict[str, dict[str, str]]:
    """The wordings of the registry, by code and variant."""
    found = {}
    for path in sorted((_ROOT / "src" / "femtune" / "messages").glob("*.toml")):
        for problem, entry in tomllib.loads(path.read_text(encoding="utf-8")).items():
            code = f"{path.stem}.{problem}"
            found[code] = entry
            found |= {f"{code}/{name}": one for name, one in entry.items() if isinstance(one, dict)}
    return {code: one for code, one in found.items() if "what" in one}


def _constants() -> set[str]:
    """All texts of the program that look like a code of an area of the registry."""
    areas = {code.partition(".")[0] for code in _messages()}
    trees = map(_tree, [*_MODULES, *(_ROOT / "examples").rglob("*.py")])
    texts = {n.value for t in trees for n in ast.walk(t) if isinstance(n, ast.Constant) and isinstance(n.value, str)}
    codes = {text for text in texts if _CODE.fullmatch(text) and text.partition(".")[0] in areas}
    return {code for code in codes if code.partition(".")[2] not in (*_SUFFIXES, "jsonl")}


@pytest.mark.slow
def test_codes_that_are_raised_are_in_the_registry_and_all_of_the_registry_is_used() -> None:
    # a reason of the verdict takes its words for the line beside its sentence
    sentences = {code for code in _messages() if not code.endswith(("/brief", "-brief"))}
    assert sorted(_constants() ^ sentences) == []


@pytest.mark.slow
def test_errors_and_notices_give_the_facts_that_their_wording_names() -> None:
    messages = _messages()
    for node in (node for path in _MODULES for node in ast.walk(_tree(path))):
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in ("FemtuneError", "Notice")
        ):
            given = {k.arg for k in node.keywords}
            if len(node.args) != 1 or not isinstance(node.args[0], ast.Constant) or None in given:
                continue
            one = messages[str(node.args[0].value)]
            texts = [one["what"]] if "hint" in given else [one["what"], one.get("hint", "")]
            fields = {f for text in texts for _, f, *_ in string.Formatter().parse(text) if f}
            assert {re.split(r"[.\[]", f)[0] for f in fields} <= given - _OF_ERRORS, ast.unparse(node)


@pytest.mark.slow
def test_tests_share_builders_and_use_public_names() -> None:
    """What two tests need is in a module of its own; a unit that is tested by itself has a public name."""
    paths = sorted((_ROOT / "tests").rglob("*.py"))
    imports = [(path, node) for path in paths for node in ast.walk(_tree(path)) if isinstance(node, ast.ImportFrom)]
    of_tests = [
        path for path, node in imports if any(part.startswith("test_") for part in (node.module or "").split("."))
    ]
    private = [path for path, node in imports if any(name.name.startswith("_") for name in node.names)]
    private += [path for path in paths if any(map(_is_private, ast.walk(_tree(path))))]
    assert [str(path) for path in (*of_tests, *private)] == []


def _is_private(node: ast.AST) -> bool:
    """Whether a private name of another module or object is used or replaced."""
    if isinstance(node, ast.Attribute):
        own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls", "os")
        return not own and re.fullmatch(r"_[a-zA-Z]\w*[a-zA-Z0-9]", node.attr) is not None
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "setattr":
        words = node.args[:2]
    elif isinstance(node, ast.Tuple) and len(node.elts) == 3:
        # owner, name and value of what is replaced
        words = node.elts[1:2]
    else:
        return False
    names = [word.value for word in words if isinstance(word, ast.Constant) and isinstance(word.value, str)]
    return any(re.search(r"(^|\.)_[a-zA-Z]\w*$", name) for name in names)


_HOMONYMS: dict[frozenset[str], str] = {}
"""Sets of words that two types have by chance, and why they are two."""
_LEAST_WORDS = 3
"""Words from which on two equal sets are no chance: "left" and "right" are sides of many things."""


def _literals(tree: ast.Module) -> Iterator[frozenset[str]]:
    """The words of each ``Literal[…]`` that consists of texts alone."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "Literal":
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            words = [part.value for part in parts if isinstance(part, ast.Constant) and isinstance(part.value, str)]
            if len(words) == len(parts):
                yield frozenset(words)


@pytest.mark.slow
def test_words_of_a_kind_stand_in_one_literal() -> None:
    """The second type takes the name of the first one, in a module ``kinds`` where layers lie between them."""
    places: dict[frozenset[str], list[str]] = {}
    for path in _MODULES:
        for words in _literals(_tree(path)):
            places.setdefault(words, []).append(path.relative_to(_ROOT / "src").as_posix())
    assert len(places) > 50
    twins = {words for words, files in places.items() if len(files) > 1 and len(words) >= _LEAST_WORDS}
    assert {tuple(sorted(words)): places[words] for words in twins - set(_HOMONYMS)} == {}
    assert set(_HOMONYMS) <= twins


def _is_number(node: ast.expr) -> bool:
    """Whether an expression is made of numbers alone: ``1 << 20``, ``-4``, ``0.5 + 3.0**0.5``."""
    if isinstance(node, ast.BinOp):
        return _is_number(node.left) and _is_number(node.right)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float) and not isinstance(node.value, bool)


def _has_reason(body: list[ast.stmt], at: int, lines: list[str]) -> bool:
    """A docstring after the run of lines that a constant belongs to, or a comment above it or beside it."""
    after, line = at + 1, body[at].lineno - 1
    while (
        after < len(body) and isinstance(body[after], ast.Assign) and body[after].lineno == body[after - 1].lineno + 1
    ):
        after += 1
    documented = after < len(body) and isinstance(body[after], ast.Expr)
    above = line - 1
    while re.match(r"\w+ = ", lines[above]):
        above -= 1
    return documented or "#" in lines[line] or lines[above].startswith("#")


@pytest.mark.slow
def test_numbers_of_a_module_have_a_reason() -> None:
    """Each number has a name of its own, and says what it is and why it has this value."""
    without, several, count = [], [], 0
    for path in _MODULES:
        lines, body = path.read_text(encoding="utf-8").splitlines(), _tree(path).body
        for at, node in enumerate(body):
            if not isinstance(node, ast.Assign):
                continue
            place = f"{path.relative_to(_ROOT / 'src')}:{node.lineno}"
            if isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
                several += [place] if all(map(_is_number, node.value.elts)) else []
            elif _is_number(node.value):
                count += 1
                without += [] if _has_reason(body, at, lines) else [place]
    assert count > 1000
    assert (without, several) == ([], [])
