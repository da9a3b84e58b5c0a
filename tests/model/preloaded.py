"""Preloaded beams and strings of cards: their eigenvalues."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tests.model.decks import card

from femtune.files.nastran import build_structure, read_deck
from femtune.files.nastran.build import BuiltDeck
from femtune.model import Configuration, configure, parametric_model, solve_modes
from femtune.model.configured import ConfiguredModel
from femtune.parameters import ParameterSet

NONE = ParameterSet(())


def built(cards: Sequence[str], loads: Sequence[str], spc: tuple[int, int] = (1, 1), more: str = "") -> BuiltDeck:
    """A deck whose modes are those under the loads of set 3."""
    case = ["SUBCASE 1", f"SPC={spc[0]}", "LOAD=3", "SUBCASE 2", f"SPC={spc[1]}", "METHOD=5", "STATSUB(PRELOAD)=1"]
    text = ["SOL 103", "CEND", *case, "BEGIN BULK", *cards, *loads, "EIGRL,5,,,9", *more.splitlines(), "ENDDATA", ""]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "deck.bdf"
        path.write_text("\n".join(text))
        return build_structure(read_deck(path))


def configured(cards: Sequence[str], loads: Sequence[str], spc: tuple[int, int] = (1, 1)) -> ConfiguredModel:
    return configure(parametric_model(built(cards, loads, spc).structure, NONE, ()), Configuration())


def eigenvalues(cards: Sequence[str], loads: Sequence[str], count: int) -> np.ndarray:
    """λ = ω² of the lowest modes."""
    return (2 * np.pi * solve_modes(configured(cards, loads).at(np.zeros(0)), count).freq_hz) ** 2


def force(node: int, vector: Sequence[float]) -> str:
    return card("FORCE", 3, node, 0, 1.0, *map(float, vector))


E, AREA, INERTIA, RHO, LENGTH = 7e10, 1e-3, 8e-8, 2700.0, 2.0
