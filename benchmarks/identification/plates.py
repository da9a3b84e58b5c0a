"""A plate with 56 sensors and eight modes, two of them close, and its tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof, DofSet
from femtune.modal import FrfSet, TimeSeries
from structures.laboratory import Clock, MeasuringChain, Plant, accelerance, simulated_test, white_noise

LENGTH, WIDTH = 1.0, 0.992
"""Nearly square: the modes (1, 2) and (2, 1) lie a percent apart."""
LOWEST_HZ = 8.0
ORDERS = ((1, 1), (1, 2), (2, 1), (2, 2), (1, 3), (3, 1), (2, 3), (3, 2))
DAMPING = (0.05, 0.005, 0.005, 0.001, 0.01, 0.02, 0.002, 0.001)
SENSORS = DofSet(Dof(i + 1, "Z") for i in range(56))


def plate(channels: int = 56) -> Plant:
    """A simply supported plate of unit mass with a shaker in one corner and noise at four places.

    Parameters
    ----------
    channels : the first so many of the sensors, spread over the plate
    """
    x, y = np.meshgrid(np.arange(1, 8) / 8.0 + 0.01, np.arange(1, 9) / 9.0 + 0.007)
    at = np.random.default_rng(0).permutation(56)[:channels]
    places = np.column_stack([x.ravel(), y.ravel()])[np.sort(at)]
    square = np.array([(m / LENGTH) ** 2 + (n / WIDTH) ** 2 for m, n in ORDERS])
    freq = LOWEST_HZ * square / square[0]
    shapes = _shapes(places)
    driven = _shapes(np.array([[0.13, 0.11], [0.31, 0.87], [0.71, 0.29], [0.83, 0.77]]))
    inputs = DofSet(Dof(i + 101, "Z") for i in range(4))
    none = np.zeros((channels, 4))
    dofs = DofSet(list(SENSORS)[:channels])
    return Plant(2.0 * np.pi * freq, np.array(DAMPING), shapes, driven, none, dofs, inputs)


def _shapes(places: NDArray) -> NDArray[np.float64]:
    """(places, modes) 2 sin(mπx) sin(nπy)."""
    columns = [2.0 * np.sin(m * np.pi * places[:, 0]) * np.sin(n * np.pi * places[:, 1]) for m, n in ORDERS]
    return np.stack(columns, axis=1)


def measured_functions(noise_db: float, seed: int, lines: int = 3000) -> FrfSet:
    """Accelerances of the shaker with noise of each function `noise_db` below its mean square."""
    exact = accelerance(plate(), np.linspace(4.0, 60.0, lines))
    values = exact.values[:, [0]]
    rng = np.random.default_rng(seed)
    size = np.sqrt((np.abs(values) ** 2).mean(axis=2, keepdims=True) / 2.0) * 10.0 ** (-noise_db / 20.0)
    noise = rng.standard_normal((2, *values.shape))
    noisy = values + size * (noise[0] + 1j * noise[1])
    return FrfSet(exact.freq_hz, noisy, exact.responses, DofSet([exact.references[0]]), "accelerance")


def ambient_record(
    channels: int, duration_s: float, noise_db: float, seed: int, sampling_hz: float = 150.0
) -> TimeSeries:
    """Accelerations under noise at four places."""
    clock = Clock(duration_s, sampling_hz, 5.0)
    forces = white_noise(np.random.default_rng(1000 + seed), 4, clock.fine_samples)
    return simulated_test(plate(channels), forces, clock, MeasuringChain(noise_db), seed)
