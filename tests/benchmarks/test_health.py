"""The benchmark of doubtful models: a sample of its faults is told, and its sound decks raise no alarm."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

_FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "health"
_MODULES = ("decks", "faults", "run")
_SAMPLE = 10
"""Kinds of faults in the sample; the benchmark has all of them in all decks."""


@pytest.fixture(scope="module")
def run() -> Iterator[ModuleType]:
    """The benchmark, whose modules have names that other benchmarks have too."""
    path, before = list(sys.path), {name: sys.modules.pop(name, None) for name in _MODULES}
    sys.path.insert(0, str(_FOLDER))
    yield [importlib.import_module(name) for name in _MODULES][-1]
    sys.path[:] = path
    for name, module in before.items():
        sys.modules.pop(name, None)
        if module is not None:
            sys.modules[name] = module


@pytest.mark.slow
def test_a_sample_of_faults_is_told(run: ModuleType, tmp_path: Path) -> None:
    """One deck for each of some kinds, drawn with a seed; of the whole benchmark, 98 % are found."""
    rng = np.random.default_rng(31)
    missed = []
    for k in rng.permutation(len(run.FAULTS))[:_SAMPLE]:
        fault = run.FAULTS[k]
        for number in rng.permutation(len(run.DECKS)):
            found = run.trial(int(number), fault, tmp_path / f"{k}-{number}")
            if found is not None:
                missed += [] if found.found else [(found.deck, found.fault)]
                break
        else:
            pytest.fail(f"no deck can have the fault: {fault.name}")
    assert not missed


@pytest.mark.slow
def test_sound_decks_raise_no_alarm(run: ModuleType, tmp_path: Path) -> None:
    alarms = run.alarms_of_sound_decks(tmp_path, run.DECKS[3:8])
    assert len(alarms) == 5
    assert {name: codes for name, codes in alarms.items() if codes} == {}


def test_the_page_counts(run: ModuleType) -> None:
    tried = [run.Trial("plate", run.FAULTS[0].name, (), k > 0) for k in range(4)]
    text = run.page(tried, {"plate": []}, {"bar.dat": ["deck.far-ends"]})
    assert "the cause in 3 of 4 (75.0 %)" in text
    assert "Of 2 sound models 1 raised an alarm: bar.dat." in text
    assert "3 of 4 | plate |" in text
