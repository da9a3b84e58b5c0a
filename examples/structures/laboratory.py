"""Tests in the simulated laboratory: a plant, what shakes it, and the chain that records it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from numpy.typing import ArrayLike, NDArray
from scipy import signal

from femtune.arrays import Reals
from femtune.dofs import DofSet
from femtune.modal import Channel, FrfSet, ModeSet, TimeSeries
from femtune.model import AddedMass, Configuration, EigenSolution
from femtune.model.response import Ports

# ----------------------------------------------------------------------------------------------------
# Plant: a structure on the test bench, known by its modes, that answers forces and the shaking of its ground.


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


# ----------------------------------------------------------------------------------------------------
# The measuring chain: sensors that add noise and drift, amplifiers that clip, converters that round.


@dataclass(frozen=True)
class MeasuringChain:
    """What stands between a motion and its record.

    Parameters
    ----------
    noise_db : signal to noise ratio of every channel in dB by its own rms; infinite for none
    bits : of the converter over `range_rms` times the largest rms of all channels to each side; 0: no rounding
    range_rms : where it clips
    """

    noise_db: float = 60.0
    bits: int = 0
    range_rms: float = 10.0


def record(rng: np.random.Generator, chain: MeasuringChain, motion: Reals) -> Reals:
    """The motion (s, n) as the chain writes it down."""
    rms = motion.std(axis=1, keepdims=True)
    noisy = motion + 10.0 ** (-chain.noise_db / 20.0) * rms * rng.standard_normal(motion.shape)
    if not chain.bits:
        return np.asarray(noisy)
    full = chain.range_rms * rms.max()
    step = 2.0 * full / 2**chain.bits
    return np.asarray(step * np.round(np.clip(noisy, -full, full) / step))


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


# ----------------------------------------------------------------------------------------------------
# Plants of models and of matrices.


def plant_of_model(modes: EigenSolution, ports: Ports, damping_ratio: ArrayLike) -> Plant:
    """The elastic modes of a model point, its outputs as sensors and its inputs as forces.

    Parameters
    ----------
    modes : all modes that matter in the band and some above it
    damping_ratio : one for all modes, or (m,) one for each elastic mode
    """
    elastic = modes.eigenvalues[: modes.wanted] > 1e-6 * modes.eigenvalues[modes.wanted - 1]
    phi = modes.shapes[:, : modes.wanted][:, elastic]
    omega = np.sqrt(modes.eigenvalues[: modes.wanted][elastic])
    shapes, forcing = np.asarray(ports.outputs @ phi), np.asarray(ports.inputs.T @ phi)
    ratio = np.broadcast_to(np.asarray(damping_ratio, dtype=float), omega.shape).copy()
    direct = np.zeros((len(shapes), len(forcing)))
    return Plant(omega, ratio, shapes, forcing, direct, ports.output_labels, ports.input_labels)


def plant_of_matrices(
    mass: Reals,
    stiffness: Reals,
    damping_ratio: ArrayLike,
    outputs: Reals,
    sensors: DofSet,
    forces: Reals,
    inputs: DofSet,
) -> Plant:
    """All modes of a small supported structure.

    Parameters
    ----------
    mass, stiffness : (n, n), both positive definite
    outputs : (s, n) rows that sample the motion at the sensors
    forces : (r, n) rows of the inputs
    """
    eigenvalues, phi = la.eigh(stiffness, mass)
    ratio = np.broadcast_to(np.asarray(damping_ratio, dtype=float), eigenvalues.shape).copy()
    direct = np.zeros((len(outputs), len(forces)))
    return Plant(np.sqrt(eigenvalues), ratio, outputs @ phi, forces @ phi, direct, sensors, inputs)


def on_shaking_ground(
    mass: Reals,
    stiffness: Reals,
    damping_ratio: ArrayLike,
    outputs: Reals,
    sensors: DofSet,
    carried: Reals,
    inputs: DofSet,
) -> Plant:
    """A structure whose inputs are accelerations of its ground; sensors measure absolute accelerations.

    Parameters
    ----------
    carried : (n, r) rigid motion of the DOFs under a unit motion of the ground in each direction
    """
    eigenvalues, phi = la.eigh(stiffness, mass)
    ratio = np.broadcast_to(np.asarray(damping_ratio, dtype=float), eigenvalues.shape).copy()
    forcing = -(carried.T @ mass @ phi)
    return Plant(np.sqrt(eigenvalues), ratio, outputs @ phi, forcing, outputs @ carried, sensors, inputs)


# ----------------------------------------------------------------------------------------------------
# What shakes a structure in the laboratory: signals (n,) or (r, n), sampled at a step.


def white_noise(rng: np.random.Generator, channels: int, count: int, rms: float = 1.0) -> Reals:
    """Independent Gaussian noise (channels, count), white up to half the sampling rate."""
    return np.asarray(rms * rng.standard_normal((channels, count)))


def narrow_line(
    rng: np.random.Generator, count: int, step_s: float, freq_hz: float, width_hz: float, rms: float
) -> Reals:
    """A machine that runs at about one frequency: Gaussian noise in a band of half-power width `width_hz`."""
    pole = np.exp((-np.pi * width_hz + 2j * np.pi * freq_hz) * step_s)
    raw = signal.lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], rng.standard_normal(count))
    return np.asarray(rms * raw / np.std(raw))


def multisine(rng: np.random.Generator, lines: NDArray[np.int64], count: int, periods: int, rms: float = 1.0) -> Reals:
    """Periodic signal (count·periods,) of equal amplitudes and random phases.

    Parameters
    ----------
    lines : numbers of the excited lines of one period, each above 0 and below count/2
    count : samples of a period
    """
    spectrum = np.zeros(count // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    period = np.fft.irfft(spectrum, count)
    return np.tile(rms * period / np.std(period), periods)


def chirp(count: int, step_s: float, from_hz: float, to_hz: float, periods: int = 1, peak: float = 1.0) -> Reals:
    """Sine whose frequency runs linearly through a band in every period of `count` samples."""
    t = step_s * np.arange(count)
    return np.tile(peak * signal.chirp(t, from_hz, count * step_s, to_hz), periods)


def burst_random(rng: np.random.Generator, count: int, blocks: int, share: float = 0.6, rms: float = 1.0) -> Reals:
    """Noise in the first `share` of every block of `count` samples and silence after it."""
    raw = rms * rng.standard_normal((blocks, count))
    raw[:, int(share * count) :] = 0.0
    return np.asarray(raw.ravel())
