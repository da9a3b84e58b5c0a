"""Models of every card: serial, in worker processes and on a Dask cluster, with the same bits."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from tests.files.nastran.every_card import DECKS

from femtune.errors import FemtuneError
from femtune.executor import Cluster, Executor, Processes, Serial
from femtune.files.nastran.build import build_structure
from femtune.files.nastran.deck import read_deck
from femtune.model import Assignment, Configuration, ConfiguredModel, configure, parametric_model
from femtune.parameters import Parameter, ParameterSet

_ROOT = Path(__file__).resolve().parents[2]
_SAMPLE = random.Random(7).sample(sorted(name for name in DECKS if name.startswith("sample")), 4)


@dataclass(frozen=True)
class Matrices:
    """Bytes of stiffness and mass at a changed value, and of products in which rounding shows."""

    change: float

    def __call__(self, configured: ConfiguredModel) -> bytes:
        point = configured.at(np.array([self.change]))
        matrices = (point.stiffness, point.mass, point.stiffness @ point.stiffness)
        return b"".join(matrix.toarray().tobytes() for matrix in matrices)


def _models(names: list[str], folder: Path) -> list[ConfiguredModel]:
    """A model of each deck for each of its cards, where a field of the card can be a parameter."""
    return [model for name in names for model in _of_deck(name, folder)]


def _of_deck(name: str, folder: Path) -> Iterator[ConfiguredModel]:
    for file, content in DECKS[name].items():
        (folder / file).write_text(content, encoding="latin-1")
    structure = build_structure(read_deck(folder / "deck.bdf"), True).structure
    parameters = ParameterSet((Parameter("p"),))
    done: set[str] = set()
    for ref in structure.values.refs:
        if ref.card in done:
            continue
        try:
            yield configure(parametric_model(structure, parameters, [Assignment("p", ref)]), Configuration())
            done.add(ref.card)
        except FemtuneError:
            # a field without effect, or one that is zero
            continue


def _check(executor: Executor, models: list[ConfiguredModel]) -> None:
    work = Matrices(0.03)
    expected, found = Serial().run(work, models), executor.run(work, models)
    assert len(models) >= 1
    assert [i for i, (one, other) in enumerate(zip(expected, found, strict=True)) if one != other] == []


@pytest.mark.slow
def test_cards_in_processes(tmp_path: Path) -> None:
    _check(Processes(2), _models(_SAMPLE, tmp_path))


@pytest.mark.slow
@pytest.mark.long
def test_every_card_in_processes(tmp_path: Path) -> None:
    models = _models(list(DECKS), tmp_path)
    assert len(models) > len(DECKS)
    _check(Processes(2), models)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_cards_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    _check(cluster, _models(_SAMPLE, tmp_path))


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.filterwarnings("ignore")
def test_every_card_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    _check(cluster, _models(list(DECKS), tmp_path))
