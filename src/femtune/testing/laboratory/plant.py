"""Plant: a structure on the test bench, known by its modes, that answers forces and the shaking of its ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from femtune.dofs import DofSet
from femtune.modal import FrfSet, ModeSet

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plant:
    """q̈ + 2ζωq̇ + ω²q = Fᵀu for every mode, accelerations ÿ = Φq̈ + D u at the sensors.

    Parameters
    ----------
    omega_rad_s, damping_ratio : (m,) of the modes, ω > 0
    shapes : Φ (s, m) mass-normalised at the sensors
    forcing : F (r, m) what each input does to the modes: shapes where it is a force
    direct : D (s, r) acceleration that an input brings with it: ones where the ground carries a sensor along
    sensors, inputs : their DOFs
    """

    omega_rad_s: Reals
    damping_ratio: Reals
    shapes: Reals
    forcing: Reals
    direct: Reals
    sensors: DofSet
    inputs: DofSet

    @property
    def truth(self) -> ModeSet:
        """The modes that an identification has to find."""
        return ModeSet(
            self.omega_rad_s / (2.0 * np.pi),
            self.shapes,
            self.sensors,
            damping_ratio=self.damping_ratio,
            normalisation="mass",
            source="simulated structure",
        )


def accelerance(plant: Plant, freq_hz: Reals) -> FrfSet:
    """Acceleration over input (s, r, k), exact; the input may be a ground acceleration."""
    w = 2.0 * np.pi * np.asarray(freq_hz, dtype=float)[:, None]
    below = plant.omega_rad_s**2 - w**2 + 2j * plant.damping_ratio * plant.omega_rad_s * w
    values = np.einsum("sm,km,rm->srk", plant.shapes, -(w**2) / below, plant.forcing) + plant.direct[:, :, None]
    return FrfSet(np.asarray(freq_hz, float), values, plant.sensors, plant.inputs, "accelerance", source="simulated")


def accelerations(plant: Plant, inputs: Reals, step_s: float) -> Reals:
    """(s, n) accelerations under inputs (r, n) that run straight between their samples, from rest; exact."""
    answer = np.empty((len(plant.omega_rad_s), inputs.shape[1]))
    for j, modal_force in enumerate(plant.forcing.T @ inputs):
        answer[j] = signal.lfilter(*_filter(plant.omega_rad_s[j], plant.damping_ratio[j], step_s), modal_force)
    return np.asarray(plant.shapes @ answer + plant.direct @ inputs)


def _filter(omega: float, ratio: float, step_s: float) -> tuple[Reals, Reals]:
    """Numerator and denominator of modal force -> q̈ for inputs that are straight between samples."""
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * ratio * omega]])
    row = a[1:]
    discrete = signal.cont2discrete((a, np.array([[0.0], [1.0]]), row, np.ones((1, 1))), step_s, method="foh")
    numerator, denominator = signal.ss2tf(*discrete[:4])
    return numerator[0], denominator
