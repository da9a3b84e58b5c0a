"""Simulated tests: structures drawn from a seed, and what a laboratory records of them under each excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
KINDS = ("hammer, 1 hit", "hammer, 5 hits", "burst", "sweep", "ambient", "ambient with harmonics")
KNOWN_FORCE = KINDS[:4]
RATE = 320.0
"""Sampling rate, Hz."""
BAND = (6.0, 110.0)
"""Where modes are looked for, Hz; one more mode is above it."""
ABOVE = 131.0
STRUCTURES = 20
DAMPING = np.geomspace(0.001, 0.08, STRUCTURES)
"""Mean damping ratio of each structure; its modes have 0.7 to 1.4 times as much."""
CHANNELS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 40)
NOISE_DB = (20, 30, 40, 50, 60)
CLOSE = (None, None, 1.0, 0.3, 0.1)
"""Distance of the two modes of a close pair over the mean of their half-power bandwidths; None: no pair."""
FORCE_NOISE = 1e-4
"""Noise of the force beside its rms: the chain is good, 80 dB."""
AMBIENT_S = 200.0
SWEEP_S = 100.0
BURSTS = 8
QUANTITIES = ("acceleration", "velocity", "displacement")


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes at the channels; the last mode is above the band.

    Parameters
    ----------
    freq_hz, damping_ratio : (m + 1,)
    shapes : (n, m + 1) at the channels
    forced : (m + 1, r) what white forces at r places do to the modes; the force of a hammer or shaker is at channel 1
    noise_db : of each channel below its rms
    close : positions of the two modes of a close pair, or None
    apart : their distance over their bandwidth
    """

    seed: int
    freq_hz: Reals
    damping_ratio: Reals
    shapes: Reals
    forced: Reals
    noise_db: float
    close: tuple[int, int] | None
    apart: float | None

    @property
    def inside(self) -> int:
        """Modes in the band."""
        return len(self.freq_hz) - 1

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Rad/s, upper half plane."""
        omega = 2.0 * np.pi * self.freq_hz
        return np.asarray(omega * (-self.damping_ratio + 1j * np.sqrt(1.0 - self.damping_ratio**2)))


def structure(seed: int) -> Structure:
    """One of `STRUCTURES`; further seeds repeat the damping ratios with other levels of the rest."""
    rng = np.random.default_rng([32, seed])
    turn = seed // STRUCTURES
    order = np.random.default_rng(32 + turn).permutation(STRUCTURES)
    ratio = DAMPING[order[seed % STRUCTURES]]
    modes = int(rng.integers(3, 8))
    step = (np.arange(modes) + rng.uniform(0.3, 0.7, modes)) / modes
    freq = 9.0 * (90.0 / 9.0) ** step
    damping = ratio * rng.uniform(0.7, 1.4, modes)
    apart = CLOSE[seed % len(CLOSE)]
    close = None
    if apart is not None:
        low = int(rng.integers(0, modes))
        freq = np.insert(freq, low + 1, freq[low] * (1.0 + 2.0 * apart * damping[low]))
        damping = np.insert(damping, low + 1, damping[low] * rng.uniform(0.8, 1.25))
        order = np.argsort(freq)
        freq, damping = freq[order], damping[order]
        close = (int(np.flatnonzero(order == low)[0]), int(np.flatnonzero(order == low + 1)[0]))
    freq, damping = np.append(freq, ABOVE), np.append(damping, ratio)
    channels = CHANNELS[(seed + seed // len(CHANNELS)) % len(CHANNELS)]
    # no mode has a node at all channels, and none at the force
    shapes = rng.uniform(0.3, 1.0, (channels, len(freq))) * rng.choice((-1.0, 1.0), (channels, len(freq)))
    forced = rng.standard_normal((len(freq), 2 * len(freq)))
    noise = NOISE_DB[(seed + seed // len(NOISE_DB)) % len(NOISE_DB)]
    return Structure(seed, freq, damping, shapes, forced, noise, close, apart)


@dataclass(frozen=True, eq=False)
class Recorded:
    """A record, and what is known of it.

    Parameters
    ----------
    responses : (n, samples)
    quantities : (n,) of the responses
    force : (samples,) as recorded, or None
    blocks : first and last sample of each hit, burst or sweep
    noise_sd : (n,) of the noise of the responses
    force_sd : of the noise of the force
    lines_hz : harmonics in the record
    """

    responses: Reals
    quantities: tuple[str, ...]
    force: Reals | None
    blocks: tuple[tuple[int, int], ...]
    noise_sd: Reals
    lines_hz: tuple[float, ...] = ()
    force_sd: float = 0.0


def recorded(one: Structure, kind: str) -> Recorded:
    """The record of a structure under an excitation; always the same."""
    rng = np.random.default_rng([one.seed, KINDS.index(kind)])
    return _forced(one, kind, rng) if kind in KNOWN_FORCE else _ambient(one, kind, rng)


def decay_s(one: Structure) -> float:
    """Length of a block, in which the slowest mode decays to a hundredth; 25.6 s at most, 1.6 s at least."""
    slowest = float(np.min(one.damping_ratio[:-1] * one.freq_hz[:-1])) * 2.0 * np.pi
    return float(2.0 ** np.clip(np.ceil(np.log2(4.6 / slowest / 1.6)), 0, 4) * 1.6)


def _forced(one: Structure, kind: str, rng: np.random.Generator) -> Recorded:
    block = round(decay_s(one) * RATE)
    if kind == "sweep":
        count, block = 1, round(SWEEP_S * RATE) + block
    else:
        count = {"hammer, 1 hit": 1, "hammer, 5 hits": 5, "burst": BURSTS}[kind]
    samples, before = count * block, 40
    force = np.zeros(samples)
    for i in range(count):
        at = i * block + before
        if kind == "burst":
            length = round(0.5 * block)
            ramp = np.minimum(1.0, np.minimum(np.arange(length), np.arange(length)[::-1]) / 16.0)
            force[at : at + length] = ramp * rng.standard_normal(length)
        elif kind == "sweep":
            length = round(SWEEP_S * RATE)
            t = np.arange(length) / RATE
            force[at : at + length] = np.sin(2.0 * np.pi * (4.0 * t + 0.5 * (116.0 / SWEEP_S) * t**2))
        else:
            force[at] = rng.uniform(0.7, 1.3)
    force = _low_pass(force)
    motion = _response(one, one.shapes[0][:, None] * force, np.zeros(len(one.shapes)))
    size = motion.std(axis=1) * 10.0 ** (-one.noise_db / 20.0)
    noisy = motion + size[:, None] * rng.standard_normal(motion.shape)
    force_sd = FORCE_NOISE * float(force.std())
    measured = force + force_sd * rng.standard_normal(samples)
    blocks = tuple((i * block, (i + 1) * block) for i in range(count))
    return Recorded(noisy, ("acceleration",) * len(noisy), measured, blocks, size, force_sd=force_sd)


def _ambient(one: Structure, kind: str, rng: np.random.Generator) -> Recorded:
    settle = round(30.0 * RATE)
    samples = round(AMBIENT_S * RATE) + settle
    forces = one.forced @ _low_pass(rng.standard_normal((one.forced.shape[1], samples)))
    channels = len(one.shapes)
    mixed = channels >= 3 and one.seed % 2 == 1
    kinds = np.arange(channels) % 3 if mixed else np.zeros(channels, int)
    motion = _response(one, forces, kinds.astype(float))[:, settle:]
    lines: tuple[float, ...] = ()
    if kind == "ambient with harmonics":
        lines = _lines(one, rng)
        t = np.arange(motion.shape[1]) / RATE
        rms = motion.std(axis=1)
        for hz in lines:
            level = rms * rng.uniform(0.3, 2.0) * rng.uniform(0.2, 1.0, channels) * rng.choice((-1.0, 1.0), channels)
            motion = motion + np.sqrt(2.0) * np.outer(level, np.sin(2.0 * np.pi * hz * t + rng.uniform(0.0, 6.28)))
    size = motion.std(axis=1) * 10.0 ** (-one.noise_db / 20.0)
    noisy = motion + size[:, None] * rng.standard_normal(motion.shape)
    quantities = tuple(QUANTITIES[k] for k in kinds)
    return Recorded(noisy, quantities, None, ((0, noisy.shape[1]),), size, lines)


def _lines(one: Structure, rng: np.random.Generator) -> tuple[float, ...]:
    """A machine and twice its speed, and the mains; none within the bandwidth of a mode."""

    def clear(hz: float) -> bool:
        return bool(np.all(np.abs(hz - one.freq_hz) > 2.0 * one.damping_ratio * one.freq_hz + 0.3))

    speeds = [hz for hz in rng.uniform(8.0, 50.0, 400) if clear(hz) and clear(2.0 * hz)]
    speeds = speeds or [hz for hz in rng.uniform(8.0, 50.0, 400) if clear(hz)]
    machine = [speeds[0]] + ([2.0 * speeds[0]] if clear(2.0 * speeds[0]) else []) if speeds else []
    return tuple(map(float, (*machine, *((50.0,) if clear(50.0) else ()))))


def _low_pass(values: Reals) -> Reals:
    """Without what is beyond 0.45 of the rate, as behind a filter against aliases; zero phase."""
    hz = np.fft.rfftfreq(values.shape[-1], 1.0 / RATE)
    gain = 0.5 * (1.0 + np.cos(np.pi * np.clip((hz / RATE - 0.42) / 0.06, 0.0, 1.0)))
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * gain, values.shape[-1]))


def _response(one: Structure, modal_forces: Reals, integrations: Reals) -> Reals:
    """(n, samples) exact for forces without content at half the rate, from rest."""
    samples = modal_forces.shape[1]
    slowest = float(np.min(one.damping_ratio * one.freq_hz)) * 2.0 * np.pi
    padded = samples + round(14.0 / slowest * RATE)
    padded = int(2 ** np.ceil(np.log2(padded)))
    omega = 2.0 * np.pi * np.fft.rfftfreq(padded, 1.0 / RATE)
    own = 2.0 * np.pi * one.freq_hz[:, None]
    h = -(omega**2) / (own**2 - omega**2 + 2j * one.damping_ratio[:, None] * own * omega)
    modal = h * np.fft.rfft(modal_forces, padded)
    out = np.empty((len(one.shapes), samples))
    # lines at zero have no motion
    integrated = np.where(omega > 0.0, 1.0 / (1j * np.where(omega > 0.0, omega, 1.0)), 0.0)
    for i, shape in enumerate(one.shapes):
        out[i] = np.fft.irfft(integrated ** integrations[i] * (shape @ modal), padded)[:samples]
    return out
