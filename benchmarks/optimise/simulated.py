"""A test simulated on a structure whose elements differ from the model's, with noise of stated size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from objective import BestPairing

from femtune.dofs import DofSet
from femtune.modal import ModeSet
from femtune.model import ConfiguredModel, solve_modes
from femtune.residuals import ComparedCase, FrequencyResidual, ShapeResidual
from femtune.residuals.kinds import ShapeScaling
from femtune.residuals.weights import Weights
from structures.springs import sensor_rows

FURTHER_MODES = 5
"""Model modes beyond those of the test, which modes that move may come from."""


@dataclass(frozen=True)
class Simulation:
    """What is measured, and how well.

    Parameters
    ----------
    modes, sensors : how many of each
    frequency_sd, shape_sd : relative standard deviations; those of single frequencies and sensors are spread over a
        decade about them, by a logarithmic uniform distribution, so that all together span two decades
    scaling : of the shapes
    """

    modes: int
    sensors: int
    frequency_sd: float = 0.003
    shape_sd: float = 0.03
    scaling: ShapeScaling = "unit-norm"


def simulated(
    model: ConfiguredModel, truth: ConfiguredModel, what: Simulation, seed: int, sensors: Sequence[int] | None = None
) -> BestPairing:
    """The problem of a model with the noisy modes of another one of the same DOFs at the nominal values.

    `sensors` are free DOFs to choose from; all where None.
    """
    rng = np.random.default_rng([seed, 1])
    choice = np.arange(model.n_free) if sensors is None else np.asarray(sensors)
    at = np.sort(rng.choice(choice, min(what.sensors, len(choice)), replace=False))
    rows, dofs = sensor_rows(model, at), DofSet(model.free_dof(int(i)) for i in at)
    t = what.modes
    found = solve_modes(truth.at(np.zeros(len(truth.model.parameters.free))), t)
    shapes = np.asarray(rows @ found.shapes)[:, :t]
    shapes = shapes / np.linalg.norm(shapes, axis=0)
    freq_sd = what.frequency_sd * 10.0 ** rng.uniform(-0.5, 0.5, t)
    shape_sd = what.shape_sd * 10.0 ** rng.uniform(-0.5, 0.5, len(at))
    freq = found.freq_hz[:t] * (1.0 + freq_sd * rng.standard_normal(t))
    if what.scaling == "largest-entry":
        shapes = shapes / np.abs(shapes).max(axis=0)
    shapes = shapes + shape_sd[:, None] * rng.standard_normal(shapes.shape)
    test = ModeSet(freq, shapes, dofs, freq_sd_hz=freq_sd * freq, source="simulated")
    case = ComparedCase(model, test, rows, count=t + FURTHER_MODES)
    residuals = (FrequencyResidual("test"), ShapeResidual(Weights(shape_sd), what.scaling))
    return BestPairing((case,), model.model.parameters, residuals)
