"""A small test with everything that the writer knows, for the tests of this folder."""

from __future__ import annotations

import numpy as np

from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, WireFrame, sensors_at
from femtune.units import SI

DOFS = DofSet.parse(["1X+", "1Z+", "2Y+", "7X+", "7Z+"])
"""1Y, 2X, 2Z and 7Y are not measured."""


def turned_axes() -> np.ndarray:
    """Identity at nodes 1 and 2; at node 7 x points along global y."""
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return np.stack([np.eye(3), np.eye(3), turn])


def sample_frame() -> WireFrame:
    points = np.array([[0.0, 0.0, 0.0], [1.0 / 3.0, 0.0, 0.25], [-1.5, 2.0, 1e-3]])
    return WireFrame(np.array([1, 2, 7]), points, turned_axes(), ((1, 2, 7),), ((1, 2), (1, 2, 7)))


def sample_shapes() -> np.ndarray:
    return np.array([[1.0, -0.25], [0.5, 1.0], [-0.123456, 0.0], [1.5e-7, 2.5], [-2.0, 0.75]])


def sample_modes(shapes: np.ndarray | None = None, **other: object) -> ModeSet:
    values = sample_shapes() if shapes is None else shapes
    damping = np.array([0.01, 0.0225])
    freq = np.array([3.25, 11.0625])
    return ModeSet(freq, values, DOFS, ("1", "4"), damping, **other)  # type: ignore[arg-type]


def sample_test(modes: ModeSet | None = None, name: str = "BC") -> ModalTest:
    frame = sample_frame()
    modes = modes or sample_modes(normalisation="mass")
    return ModalTest(name, SI, frame, sensors_at(frame, modes.dofs), modes)
