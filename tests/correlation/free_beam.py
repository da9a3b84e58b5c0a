"""A free slender beam whose modes are known in closed form."""

from __future__ import annotations

import numpy as np

from femtune.dofs import Dof, DofSet
from femtune.modal import ModeSet

N = 12
"""Sensors."""
EVERYWHERE = np.linspace(0.0, 1.0, N)


def beam(sensors: np.ndarray, soft_hz: float = 0.0, stiffer: float = 1.0, modes: int = 7) -> ModeSet:
    """A free slender beam of unit length and mass at some sensors: two rigid-body modes and its bending modes.

    On a continuous soft foundation the shapes are the same and λ grows by (2π soft_hz)². Source: Blevins, Formulas for
    Natural Frequency and Mode Shape, table 8-1.
    """
    roots = np.array([4.730040745, 7.853204624, 10.995607838, 14.137165491, 17.278759657])
    x = np.linspace(0.0, 1.0, len(sensors))[sensors] if sensors.dtype == bool else sensors
    columns, hertz = [np.ones(len(x)), np.sqrt(12.0) * (x - 0.5)], [0.0, 0.0]
    for b in roots[: modes - 2]:
        s = (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b))
        columns.append(np.cosh(b * x) + np.cos(b * x) - s * (np.sinh(b * x) + np.sin(b * x)))
        hertz.append(40.0 * stiffer * (b / roots[0]) ** 2)
    freq = np.sqrt(np.array(hertz) ** 2 + soft_hz**2)
    return ModeSet(freq, np.array(columns).T, DofSet(Dof(i + 1, "Z") for i in range(len(x))))
