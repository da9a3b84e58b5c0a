"""Six frequencies of a plane frame over the moduli of four groups of its bars; modes are followed by their shape."""

from __future__ import annotations

import sys
from functools import cached_property
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

import numpy as np

from femtune.experiments import latin_hypercube
from femtune.modal.assignment import linear_sum_assignment
from femtune.model import solve_modes
from structures.cross_frame import cross_frame

RUNS, FRESH, RANGE = 150, 500, 0.25
MODES, SOLVED = 6, 14
RIGID = 3


class Frame:
    """The model; called with relative moduli minus one (n, 4), it gives frequencies (n, 6) in Hz."""

    @cached_property
    def configured(self):
        """The frame, held out of its plane."""
        return cross_frame()

    @cached_property
    def reference(self) -> np.ndarray:
        """(6, free DOFs) nominal shapes times the mass matrix."""
        found = solve_modes(self.configured.at(np.zeros(4)), SOLVED)
        return np.asarray((found.point.mass @ found.shapes[:, RIGID : RIGID + MODES]).T)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return np.array([self._at(x) for x in points])

    def _at(self, x: np.ndarray) -> np.ndarray:
        found = solve_modes(self.configured.at(x), SOLVED)
        overlap = (self.reference @ found.shapes[:, RIGID:SOLVED]) ** 2
        return np.asarray(found.freq_hz[RIGID + linear_sum_assignment(-overlap)[1]])


def data() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points and responses of the runs, and of fresh runs; points are in the unit cube."""
    model = Frame()
    x, new = latin_hypercube(4, RUNS, 1).points, np.random.default_rng(2).random((FRESH, 4))
    return x, model(RANGE * (2.0 * x - 1.0)), new, model(RANGE * (2.0 * new - 1.0))
