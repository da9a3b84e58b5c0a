"""Records of a hammer on a structure with three known modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from femtune.dofs import Dof
from femtune.errors import Notice
from femtune.modal import Channel, TimeSeries, pole_of

RATE = 512.0
FREQ, DAMPING = np.array([22.0, 41.0, 63.0]), np.array([0.02, 0.015, 0.01])
SHAPES = np.array([[1.0, 0.7, -0.5], [0.6, -0.9, 0.8]])
CHANNELS = (Channel(Dof(1, "Z"), "force", role="input"), *(Channel(Dof(i, "Z"), "acceleration") for i in (1, 2)))


def response(force: np.ndarray, damping: np.ndarray = DAMPING, at: np.ndarray = SHAPES[0]) -> np.ndarray:
    """(2, n) accelerations of sampled modes, exact and causal: second differences of the modal coordinates."""
    y = np.zeros((2, len(force)))
    for k, pole in enumerate(np.exp(pole_of(FREQ, damping) / RATE)):
        # (1 - 1/z)^2 of the coordinate has no motion before the force
        q = lfilter(pole.imag * np.array([1.0, -2.0, 1.0]), [1.0, -2.0 * pole.real, abs(pole) ** 2], at[k] * force)
        y += np.outer(SHAPES[:, k], q)
    return y


def measured(hits: list[int], samples: int, seed: int = 0, again: int | None = None) -> TimeSeries:
    """A record with a hit at each of some samples; `again`: samples after which the first hit bounces."""
    rng, force, pulse = np.random.default_rng(seed), np.zeros(samples), 50.0 * np.hanning(7)
    for at in hits:
        force[at : at + 7] += pulse * rng.uniform(0.7, 1.3)
    if again is not None:
        force[hits[0] + again : hits[0] + again + 7] += 0.6 * pulse
    y = response(force)
    noise = rng.standard_normal((3, samples)) * np.array([[0.02], [3e-4 * y.std()], [3e-4 * y.std()]])
    return TimeSeries(np.vstack([force, y]) + noise, CHANNELS, RATE)


def written(record: TimeSeries, path: Path) -> Path:
    np.savetxt(path, record.values.T, delimiter=",", header="force,1Z+,2Z+", comments="", fmt="%.7g")
    return path


def codes(notices: tuple[Notice, ...]) -> list[str]:
    return [n.code for n in notices]
