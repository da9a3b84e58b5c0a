"""Faults of single channels of a record: how often sound channels are named, and how often faults are found.

    python benchmarks/identification/channels.py [--records 20] [--evidence docs/evidence]

Writes `benchmark_channels.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from harmonics import FREQ, record, responses
from numpy.typing import NDArray
from scipy.signal import lfilter

from femtune.identification.late_channels import late_channels
from femtune.identification.operational import Operational, by_covariances
from femtune.identification.record_checks import check_record

RATE, SECONDS = 100.0, 300.0
RATIOS = np.array([0.01, 0.012, 0.008, 0.015, 0.01])
FAULTY = 2
"""Position of the channel with a fault."""

Values = NDArray[np.float64]


def sound(seed: int, level: str = "steady") -> Values:
    """(6, samples) Responses under forces of a constant level, of one that wanders, or of single vehicles."""
    values = responses(seed, 1.0, RATE, SECONDS, RATIOS)
    rng, samples = np.random.default_rng([seed, 1]), values.shape[1]
    if level == "wind":
        gusts = lfilter([1.0], [1.0, -np.exp(-1.0 / (20.0 * RATE))], rng.standard_normal(samples))
        return values * np.exp(0.5 * gusts / gusts.std())
    if level == "vehicles":
        arrivals = rng.random(samples) < 0.1 / RATE
        return values * (
            0.2 + lfilter([1.0], [1.0, -np.exp(-1.0 / (3.0 * RATE))], arrivals * rng.exponential(1.0, samples))
        )
    return values


def late(seed: int, samples: int) -> Values:
    values = sound(seed)
    values[FAULTY] = np.roll(values[FAULTY], samples)
    return values[:, abs(samples) :]


def clipped(seed: int, at: float, noise: float) -> Values:
    """At a number of standard deviations, with noise behind the amplifier relative to the channel."""
    values, rng = sound(seed), np.random.default_rng([seed, 2])
    size = values[FAULTY].std()
    values[FAULTY] = np.clip(values[FAULTY], -at * size, at * size) + noise * size * rng.standard_normal(
        values.shape[1]
    )
    return values


def burst(seed: int, share: float, seconds: float, of_all: bool) -> Values:
    """A decaying oscillation of 3.4 Hz with this part of the power of the channel."""
    values = sound(seed)
    t = np.arange(values.shape[1]) / RATE - 0.4 * SECONDS
    shape = np.where(t >= 0.0, np.exp(-3.0 * np.maximum(t, 0.0) / seconds), 0.0) * np.sin(2.0 * np.pi * 3.4 * t)
    for i in range(len(values)) if of_all else (FAULTY,):
        values[i] += shape * np.sqrt(share / (1.0 - share) * np.sum(values[i] ** 2) / np.sum(shape**2))
    return values


def drifting(seed: int, share: float) -> Values:
    """A random walk with this part of the power."""
    values, rng = sound(seed), np.random.default_rng([seed, 3])
    walk = np.cumsum(rng.standard_normal(values.shape[1]))
    walk -= walk.mean()
    values[FAULTY] += walk * np.sqrt(share / (1.0 - share) * np.sum(values[FAULTY] ** 2) / np.sum(walk**2))
    return values


def named(values: Values, code: str) -> set[int]:
    """Positions of the channels that notices of a code name."""
    if code == "identify.late-channel":
        found = by_covariances(record(values, RATE), Operational((2.0, 30.0), 30))
        return {one.channel for one in late_channels(found.complex_shapes, found.modes.freq_hz, 1.0 / RATE)}
    said = " ".join(n.what for n in check_record(record(values, RATE)) if n.code == code)
    return {i for i in range(len(values)) if f"{i + 1}Z+" in said}


LEVEL_CODES = ("record.clipped", "record.bursts", "record.drifting", "record.spikes", "identify.late-channel")
LEVELS = ("steady", "wind", "vehicles")
FAULTS: dict[str, tuple[str, Callable[[int], Values]]] = {
    **{f"late by {n} samples": ("identify.late-channel", lambda s, n=n: late(s, n)) for n in (1, 2, 5, 20, -3)},
    **{
        f"clipped at {at:g} σ, noise {100 * noise:g} %": ("record.clipped", lambda s, a=at, n=noise: clipped(s, a, n))
        for at in (1.0, 2.0, 3.0)
        for noise in (0.0, 0.01)
    },
    **{
        f"burst of {t:g} s, {100 * p:g} % of the power, {'all channels' if a else 'one channel'}": (
            "record.bursts",
            lambda s, p=p, t=t, a=a: burst(s, p, t, a),
        )
        for p, t, a in ((0.1, 2.0, False), (0.2, 2.0, False), (0.4, 2.0, True), (0.2, 10.0, True), (0.4, 10.0, True))
    },
    **{
        f"drift of {100 * p:g} % of the power": ("record.drifting", lambda s, p=p: drifting(s, p))
        for p in (0.2, 0.4, 0.6)
    },
}


def level(records: int) -> Iterator[str]:
    yield "| channels without fault, forces | " + " | ".join(LEVEL_CODES) + " |"
    yield "| --- |" + " --- |" * len(LEVEL_CODES)
    for kind in LEVELS:
        counts = [sum(bool(named(sound(s, kind), code)) for s in range(records)) for code in LEVEL_CODES]
        yield f"| {kind}, {records} records of 6 channels | " + " | ".join(map(str, counts)) + " |"


def power(records: int) -> Iterator[str]:
    yield "| fault | records | found, and on the right channel alone | another channel named |"
    yield "| --- | --- | --- | --- |"
    for name, (code, make) in FAULTS.items():
        found = [named(make(s), code) for s in range(records)]
        right = {FAULTY} if "all channels" not in name else set()
        hits = sum(one == right if right else bool(one) for one in found)
        others = sum(bool(one - right) for one in found) if right else 0
        yield f"| {name} | {records} | {hits} | {others} |"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--evidence", type=Path)
    given = parser.parse_args()
    lines = [
        "# Faults of channels",
        "",
        f"Made by `benchmarks/identification/channels.py --records {given.records}` on {datetime.now(UTC):%Y-%m-%d}.",
        f"Six accelerations of five modes from {FREQ[0]:g} to {FREQ[-1]:g} Hz under random forces, {SECONDS:g} s at",
        f"{RATE:g} Hz, 2 % of noise. Wind: a level that wanders by a factor of 1.6. Vehicles: one in ten seconds.",
        "",
        "Records in which a sound channel is named:",
        "",
        *level(given.records),
        "",
        "Faults of one channel, or of all:",
        "",
        *power(given.records),
    ]
    text = "\n".join(lines) + "\n"
    print(text)
    if given.evidence:
        (given.evidence / "benchmark_channels.md").write_text(text)


if __name__ == "__main__":
    main()
