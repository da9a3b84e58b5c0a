"""Fixtures that every part of the suite shares, and which cases of a family belong to the quick suite."""

from __future__ import annotations

import gc
import os
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# A gate must say the same of the same code, on a slow machine too; HYPOTHESIS_PROFILE=default searches at random.
settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    max_examples=100,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
settings.register_profile("quick", settings.get_profile("repeatable"), max_examples=25)
settings.register_profile("gate", settings.get_profile("repeatable"), max_examples=50)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))

_ROOT = Path(__file__).resolve().parents[1]
_GOLDEN = 0.6180339887498949


@pytest.fixture(scope="session", autouse=True)
def _files_wait_for_no_disk() -> Iterator[None]:
    """No test cuts the power, and what a process has written outlives it without `fsync`, which takes 6 to 20 ms."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        yield


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real measurements and decks; it lies beside the checkout and is no part of the project."""
    folder = Path(os.environ.get("FEMTUNE_SHARED_DATA", _ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"the shared measurements are not here: {folder} (set FEMTUNE_SHARED_DATA)")
    return folder


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option that lists the tests which this machine cannot run."""
    parser.addoption("--skipped-to", type=Path, help="file to which the ids of skipped tests are added, one a line")


def pytest_configure(config: pytest.Config) -> None:
    """Note skipped tests in the process that reports, which is no worker."""
    path = config.getoption("--skipped-to")
    if path is not None and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Skipped(path))


@dataclass(frozen=True)
class _Skipped:
    """Writes the ids of skipped tests, so that another run may repeat them where what they require is installed."""

    path: Path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.skipped and not hasattr(report, "wasxfail"):
            with self.path.open("a", encoding="utf-8") as file:
                file.write(f"{report.nodeid}\n")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[object]:
    """Collect without searching for garbage: all that is made here stays, and is searched a hundred times otherwise."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of a family marked ``quick(count)``, mark all cases slow, or `rest`, except `count`; long tests are slow ones.

    With ``gate=number`` all but so many are long.
    """
    families: dict[tuple[str, int, str, int | None], list[Any]] = defaultdict(list)
    for item in items:
        mark = item.get_closest_marker("quick")
        rest = mark.kwargs.get("rest", "slow") if mark is not None else ""
        if mark is not None and (rest == "long" or item.get_closest_marker("slow") is None):
            families[item.nodeid.partition("[")[0], mark.args[0], rest, mark.kwargs.get("gate")].append(item)
    for (_, count, rest, gate), cases in families.items():
        indices = [case.callspec.indices for case in cases]
        chosen = spread(indices, count)
        of_gate = range(len(cases)) if gate is None else spread(indices, gate)
        for number, case in enumerate(cases):
            if number not in chosen:
                case.add_marker(rest if number in of_gate else "long")
    for item in items:
        if item.get_closest_marker("long") is not None:
            item.add_marker("slow")


def spread(cases: list[dict[str, int]], count: int) -> set[int]:
    """Numbers of `count` cases in which as many different values of every argument occur as possible.

    Parameters
    ----------
    cases : the position of the value of each argument
    """
    # multiples of the golden ratio visit a range evenly, however many of them are taken
    left = sorted(range(len(cases)), key=lambda i: i * _GOLDEN % 1.0)
    used: Counter[tuple[str, int]] = Counter()
    chosen: set[int] = set()
    while left and len(chosen) < count:
        best = min(left, key=lambda i: sum(used[value] for value in cases[i].items()))
        left.remove(best)
        used.update(cases[best].items())
        chosen.add(best)
    return chosen


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder of a test, with nothing in it."""
    monkeypatch.chdir(tmp_path)
    return tmp_path
