"""Tests in the simulated laboratory: a plant, what shakes it, and the chain that records it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from femtune.dofs import DofSet
from femtune.modal import Channel, FrfSet, TimeSeries
from femtune.model import AddedMass, Configuration
from femtune.testing.laboratory.chain import MeasuringChain, record
from femtune.testing.laboratory.plant import Plant, accelerance, accelerations

Reals = NDArray[np.float64]

OVERSAMPLING = 4
"""Structures are simulated on a finer clock than they are recorded with, behind a filter that lets no alias through."""


@dataclass(frozen=True)
class Clock:
    """How long and how often is recorded.

    Parameters
    ----------
    duration_s : of the record
    sampling_hz : of the record
    settle_s : time that goes by before it begins
    """

    duration_s: float
    sampling_hz: float
    settle_s: float = 0.0

    @property
    def fine_step_s(self) -> float:
        """Step of the simulation."""
        return 1.0 / (OVERSAMPLING * self.sampling_hz)

    @property
    def fine_samples(self) -> int:
        """Samples of the simulation, those before the record included."""
        return OVERSAMPLING * (self.samples + self.settling)

    @property
    def samples(self) -> int:
        """Samples of the record."""
        return round(self.duration_s * self.sampling_hz)

    @property
    def settling(self) -> int:
        """Recorded samples that are thrown away."""
        return round(self.settle_s * self.sampling_hz)


def simulated_test(
    plant: Plant,
    inputs: Reals,
    clock: Clock,
    chain: MeasuringChain,
    seed: int,
    measured_inputs: tuple[int, ...] = (),
    input_quantity: str = "force",
) -> TimeSeries:
    """The record of a plant under inputs (r, fine_samples) on the simulation's clock.

    Parameters
    ----------
    measured_inputs : inputs that the chain records too, as channels of the role "input"
    input_quantity : "force", or "acceleration" of a ground
    """
    motion = accelerations(plant, inputs, clock.fine_step_s)
    everything = np.vstack([motion, inputs[list(measured_inputs)]])
    coarse = signal.decimate(everything, OVERSAMPLING, ftype="fir", axis=1)[:, clock.settling :]
    values = record(np.random.default_rng(seed), chain, coarse)
    responses = [Channel(dof, "acceleration") for dof in plant.sensors]
    driven = [Channel(list(plant.inputs)[i], input_quantity, role="input") for i in measured_inputs]
    return TimeSeries(values, (*responses, *driven), clock.sampling_hz, source="simulated test")


def stepped_sine(plant: Plant, freq_hz: Reals, input_at: int, noise_db: float, seed: int) -> FrfSet:
    """Accelerances of one input at irregular lines as a stepped sine measures them, settled at each line.

    Noise is complex Gaussian, of every response at a distance of `noise_db` below its mean square over the lines.
    """
    exact = accelerance(plant, freq_hz)
    values = exact.values[:, [input_at]]
    rng = np.random.default_rng(seed)
    size = np.sqrt((np.abs(values) ** 2).mean(axis=2, keepdims=True) / 2.0) * 10.0 ** (-noise_db / 20.0)
    noise = rng.standard_normal((2, *values.shape))
    reference = DofSet([list(plant.inputs)[input_at]])
    noisy = values + size * (noise[0] + 1j * noise[1])
    return replace(exact, values=noisy, references=reference, source="simulated stepped sine")


def with_sensor_masses(configuration: Configuration, sensors: DofSet, mass: float) -> Configuration:
    """The state of the structure with a mass at every node that carries a sensor."""
    nodes = sorted({dof.node for dof in sensors})
    carried = (AddedMass(node, mass, label="sensor") for node in nodes)
    return replace(configuration, masses=(*configuration.masses, *carried))
