"""One mutant against tests, in a process of its own that is split off where the tests have been collected.

Where the fault lies in the body of a function, the code of the function is exchanged: nothing is imported again, and a
trial takes as long as its tests. Elsewhere (constants of a module, defaults of arguments), and for what survived that,
the tests are collected anew with the other text of the module in place, since tests may compute numbers when their file
is imported.
"""

from __future__ import annotations

import ast
import gc
import importlib.machinery
import importlib.util
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

import pytest

MOST_GIGABYTES = 8.0
"""Limit of the address space of a trial."""


class Outcome(Enum):
    """What became of a mutant."""

    KILLED = "killed"
    KILLED_BY_TIME = "killed by the time limit"
    SURVIVED = "survived"


def with_other_code(path: Path, text: bytes, line: int, items: Sequence[pytest.Item], cpu_seconds: float) -> Outcome:
    """Run collected tests with the code of the function around a line exchanged, up to the first failure.

    Parameters
    ----------
    path, text : file, and what stands in it
    cpu_seconds : limit of the processor time; the limit of the clock is ten times as much
    """

    def run() -> int:
        _exchange(path, text, line)
        for item in items[:1]:
            item.config.pluginmanager.unregister(name="terminalreporter")
        for item, following in zip(items, [*items[1:], None]):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if item.session.testsfailed:
                return 1
        return 0

    return _in_process(run, cpu_seconds)


def imported_anew(module: str, path: Path, text: bytes, tests: Sequence[str], cpu_seconds: float) -> Outcome:
    """The same in a process that imports the module, and whatever imports it, for the first time.

    Parameters
    ----------
    tests : that exist: where pytest does not find one, the mutant spoils the import of its file
    """

    def run() -> int:
        sys.meta_path.insert(0, _Finder(module, path, text))  # type: ignore[arg-type]
        return int(pytest.main([*tests, "-x", "-p", "no:cacheprovider", "-p", "no:xdist"]))

    return _in_process(run, cpu_seconds)


# ----------------------------------------------------------------------------------------------------
# Other code for the functions that are there.


def function_around(text: bytes, line: int) -> ast.FunctionDef | None:
    """The outermost function in whose body a line lies."""
    for node in _outermost(ast.parse(text)):
        if node.body[0].lineno <= line <= (node.end_lineno or 0):
            return node
    return None


def _outermost(node: ast.AST) -> Iterator[ast.FunctionDef]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef):
            yield child
        else:
            yield from _outermost(child)


def _exchange(path: Path, text: bytes, line: int) -> None:
    function = function_around(text, line)
    if function is None:
        raise ValueError(f"no function at line {line} of {path}")
    first = min(node.lineno for node in (function, *function.decorator_list))
    new = next(
        code
        for code in _codes(compile(text, str(path), "exec", dont_inherit=True))
        if (code.co_firstlineno, code.co_name) == (first, function.name)
    )
    for thing in gc.get_objects():
        if isinstance(thing, FunctionType) and _same(thing.__code__, new):
            thing.__code__ = new


def _codes(code: CodeType) -> Iterator[CodeType]:
    for inner in (c for c in code.co_consts if isinstance(c, CodeType)):
        yield inner
        yield from _codes(inner)


def _same(one: CodeType, other: CodeType) -> bool:
    return (one.co_filename, one.co_qualname, one.co_firstlineno) == (
        other.co_filename, other.co_qualname, other.co_firstlineno
    )  # fmt: skip


# ----------------------------------------------------------------------------------------------------
# Another text for a module that is imported.


class _Mutated(importlib.machinery.SourceFileLoader):
    """Loads the text that it is given instead of that of the file."""

    def __init__(self, name: str, path: str, text: bytes) -> None:
        super().__init__(name, path)
        self.text = text

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.text, self.path, "exec", dont_inherit=True)


class _Finder:
    """Comes before all others on `sys.meta_path`."""

    def __init__(self, name: str, path: Path, text: bytes) -> None:
        self.name, self.path, self.text = name, path, text

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name != self.name:
            return None
        return importlib.util.spec_from_file_location(name, self.path, loader=_Mutated(name, str(self.path), self.text))


# ----------------------------------------------------------------------------------------------------
# A process of its own with limits.


def _in_process(run: Callable[[], int], cpu_seconds: float) -> Outcome:
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setsid()
            _limited(cpu_seconds)
            code = run()
        finally:
            os._exit(code)
    return _ended(child, time.monotonic() + 10.0 * cpu_seconds)


def _limited(cpu_seconds: float) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_seconds) + 1, int(cpu_seconds) + 2))
    resource.setrlimit(resource.RLIMIT_AS, (int(MOST_GIGABYTES * 2**30), int(MOST_GIGABYTES * 2**30)))


def _ended(child: int, until: float) -> Outcome:
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done and os.WIFSIGNALED(status):
            by_limit = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
            return Outcome.KILLED_BY_TIME if by_limit else Outcome.KILLED
        if done:
            return Outcome.SURVIVED if os.WEXITSTATUS(status) == 0 else Outcome.KILLED
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return Outcome.KILLED_BY_TIME
