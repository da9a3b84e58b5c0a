"""Small decks, and tests that are their own modes at known true values."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import femtune as ft
from femtune.steps.run.result import RunResult

from .cantilever import CANTILEVER, Bench


@contextmanager
def _without_room_for_labels() -> Iterator[None]:
    """Leave out what takes half of the time of a figure: labels are laid out twice more, to find room for them.

    `tests/reporting` looks at figures.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda self, figure: None)
        yield


@pytest.fixture(scope="module", autouse=True)
def _quick_figures() -> Iterator[None]:
    with _without_room_for_labels():
        yield


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """A folder with the cantilever as its user has it."""
    made = Bench(tmp_path)
    made.write("beam.bdf", CANTILEVER)
    return made


@pytest.fixture(scope="session")
def true_test(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The test of a beam whose root and tip have 1.3 and 0.85 times the stiffness of the deck, solved once for all."""
    made = Bench(tmp_path_factory.mktemp("truth"))
    return made.uff(made.measure(made.truth()))


@pytest.fixture
def beam(bench: Bench, true_test: Path) -> Bench:
    """The cantilever with that test."""
    bench.truth()
    shutil.copy(true_test, bench.folder)
    return bench


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory, true_test: Path) -> tuple[Bench, RunResult]:
    """A bench and a whole run on it, not to be changed."""
    made = Bench(tmp_path_factory.mktemp("finished"))
    made.write("beam.bdf", CANTILEVER)
    shutil.copy(true_test, made.folder)
    # it is made before the fixtures of a module, and its report is compared with those that are written later
    with _without_room_for_labels():
        return made, ft.run(made.study())
