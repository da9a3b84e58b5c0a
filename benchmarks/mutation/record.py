"""Which tests run which line, and how long each test takes: one run of the tests under coverage."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import coverage
import pytest


@dataclass(frozen=True)
class Record:
    """Tests by line.

    Parameters
    ----------
    seconds : of each test that passed, the fastest first
    lines : of each file and line the positions of its tests in `seconds`; a line that a fixture runs belongs to all
        tests that use the fixture
    """

    seconds: dict[str, float]
    lines: dict[str, dict[int, list[int]]]

    def covering(self, file: str, first: int, last: int) -> list[str]:
        """Tests that run any of these lines, the fastest first."""
        by_line, names = self.lines.get(file, {}), list(self.seconds)
        return [names[i] for i in sorted({i for n, tests in by_line.items() if first <= n <= last for i in tests})]

    def of_file(self, file: str) -> list[str]:
        """Tests that run any line of a file, the fastest first."""
        return self.covering(file, 0, max(self.lines.get(file, {}), default=0))


class _Contexts:
    """Plugin for pytest: tells coverage which test or fixture runs."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self.measured = measured
        self.stack = [""]
        self.users: dict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = defaultdict(float)
        self.failed: set[str] = set()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        for definitions in item._fixtureinfo.name2fixturedefs.values():
            for definition in definitions:
                self.users[_key(definition)].add(item.nodeid)
        self.users[item.nodeid].add(item.nodeid)
        return (yield from self._within(item.nodeid))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef, request: pytest.FixtureRequest) -> Iterator[None]:
        return (yield from self._within(_key(fixturedef)))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.seconds[report.nodeid] += report.duration
        if report.outcome != "passed":
            self.failed.add(report.nodeid)

    def _within(self, context: str) -> Iterator[None]:
        self.stack.append(context)
        self.measured.switch_context(context)
        try:
            return (yield)
        finally:
            self.stack.pop()
            self.measured.switch_context(self.stack[-1])


def _key(definition: pytest.FixtureDef) -> str:
    return f"fixture {definition.baseid}::{definition.argname}"


def record(root: Path, source: Path, tests: list[str], kept: Path) -> Record:
    """Run the tests once under coverage, and keep what was found."""
    measured = coverage.Coverage(data_file=None, source=[str(source)], config_file=False)
    plugin = _Contexts(measured)
    measured.start()
    try:
        pytest.main([*tests, "-p", "no:cacheprovider", "-p", "no:xdist"], plugins=[plugin])
    finally:
        measured.stop()
    passed = sorted(set(plugin.seconds) - plugin.failed, key=plugin.seconds.__getitem__)
    seconds = {test: round(plugin.seconds[test], 4) for test in passed}
    found = Record(seconds, _lines(measured.get_data(), plugin.users, passed, root))
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps({"seconds": found.seconds, "lines": found.lines}), encoding="utf-8")
    return found


def recorded(kept: Path) -> Record:
    """What an earlier run found."""
    read = json.loads(kept.read_text(encoding="utf-8"))
    lines = {file: {int(n): tests for n, tests in by_line.items()} for file, by_line in read["lines"].items()}
    return Record(read["seconds"], lines)


def _lines(
    data: coverage.CoverageData, users: dict[str, set[str]], passed: list[str], root: Path
) -> dict[str, dict[int, list[int]]]:
    position = {test: i for i, test in enumerate(passed)}
    of = {context: {position[test] for test in tests if test in position} for context, tests in users.items()}
    found: dict[str, dict[int, list[int]]] = {}
    for file in data.measured_files():
        by_line = data.contexts_by_lineno(file)
        found[str(Path(file).relative_to(root))] = {
            line: sorted(set().union(*(of.get(context, ()) for context in contexts)))
            for line, contexts in by_line.items()
        }
    return found
