"""Harmonics in output-only records: how often modes are called harmonics, and how often harmonics are found.

    python benchmarks/identification/harmonics.py [--records 20] [--critical] [--evidence docs/evidence]

Writes `benchmark_harmonics.md`. With `--critical` it prints the critical values of `femtune.identification.harmonics`
instead.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from femtune.dofs import Dof
from femtune.identification.harmonics import LEAST_DAMPING, WANDER, find_lines, without_lines
from femtune.modal import Channel, TimeSeries

FREQ = np.array([3.1, 7.4, 8.6, 14.2, 22.5])
"""Natural frequencies, times 1 or 6."""
RATIOS = np.array([0.01, 0.012, 0.008, 0.015, 0.01])
SHAPES = np.random.default_rng(20).uniform(-1.0, 1.0, (5, 6))
LINE = np.array([0.9, 0.3, 0.5, 0.7, 0.2, 0.6])
LEVELS_DB = (-30, -20, -10, -5, 0, 10, 20, 40)
RATIOS_TRIED = (5e-4, 1e-3, 2e-3, 5e-3, 1e-2)
"""Damping ratios of the records without a line."""
RECORDS = {"3 to 23 Hz, 300 s": (1.0, 100.0, 300.0), "19 to 135 Hz, 120 s": (6.0, 400.0, 120.0)}
"""Factor on the frequencies, sampling rate in Hz and duration in s."""


def responses(seed: int, factor: float, rate: float, seconds: float, ratios: NDArray) -> NDArray[np.float64]:
    """(6, samples) accelerations of five modes under white forces, with 2 % of noise."""
    rng = np.random.default_rng(seed)
    forces = rng.standard_normal((6, int(rate * seconds)))
    out = np.zeros_like(forces)
    for f, ratio, shape in zip(factor * FREQ, ratios, SHAPES):
        pole = np.exp(2.0 * np.pi * f * (-ratio + 1j * np.sqrt(1.0 - ratio**2)) / rate)
        out += np.outer(shape, lfilter([1.0, -2.0, 1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], shape @ forces))
    return np.asarray(out + 0.02 * out.std() * rng.standard_normal(out.shape))


def machine(seed: int, hz: float, rate: float, samples: int, wander: float) -> NDArray[np.float64]:
    """(6, samples) A line whose speed wanders between twelve random values."""
    at = np.linspace(0.0, 1.0, 12)
    speed = np.interp(np.linspace(0.0, 1.0, samples), at, np.random.default_rng(seed).uniform(-wander, wander, 12))
    return np.outer(LINE, np.sin(2.0 * np.pi * hz * np.cumsum(1.0 + speed) / rate))


def record(values: NDArray, rate: float) -> TimeSeries:
    return TimeSeries(values, [Channel(Dof(i + 1, "Z")) for i in range(len(values))], sampling_hz=rate)


def level(records: int) -> Iterator[str]:
    yield "| record | damping % | records | modes | modes called harmonics | other lines called harmonics |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name, (factor, rate, seconds) in RECORDS.items():
        band = (0.5 * factor * FREQ[0], 1.3 * factor * FREQ[-1])
        for ratio in RATIOS_TRIED:
            wrong = others = 0
            for seed in range(records):
                values = responses(seed, factor, rate, seconds, np.full(5, ratio))
                lines = np.array([e.freq_hz for e in find_lines(record(values, rate), band, factor * FREQ)])
                near = np.abs(lines[:, None] / (factor * FREQ) - 1.0) <= 3.0 * max(ratio, WANDER)
                wrong += int(near.any(axis=0).sum())
                others += int((~near.any(axis=1)).sum())
            count = records * len(FREQ)
            share = f"{wrong} ({100.0 * wrong / count:.1f} %)"
            yield f"| {name} | {100.0 * ratio:g} | {records} | {count} | {share} | {others} |"


def power(records: int) -> Iterator[str]:
    yield f"| record | line Hz | speed | {' | '.join(f'{db} dB' for db in LEVELS_DB)} |"
    yield f"| --- | --- | --- |{' --- |' * len(LEVELS_DB)}"
    for name, (factor, rate, seconds) in RECORDS.items():
        for place, hz in (
            ("between modes", 10.7 * factor),
            ("near a mode", 7.5 * factor),
            ("on a mode", 14.2 * factor),
        ):
            for wander in (0.0, WANDER):
                found = [
                    sum(_found(s, factor, rate, seconds, hz, db, wander) for s in range(records)) for db in LEVELS_DB
                ]
                shares = " | ".join(f"{100.0 * n / records:.0f} %" for n in found)
                yield f"| {name} | {hz:.4g}, {place} | {'wanders' if wander else 'constant'} | {shares} |"


def _with_line(
    seed: int, factor: float, rate: float, seconds: float, hz: float, db: float, wander: float
) -> tuple[NDArray, NDArray]:
    values = responses(seed, factor, rate, seconds, RATIOS)
    line = machine(seed + 999, hz, rate, values.shape[1], wander)
    return values, line * values.std() / line.std() * 10.0 ** (db / 20.0)


def _found(seed: int, factor: float, rate: float, seconds: float, hz: float, db: float, wander: float) -> bool:
    values, line = _with_line(seed, factor, rate, seconds, hz, db, wander)
    band = (0.5 * factor * FREQ[0], 1.3 * factor * FREQ[-1])
    return any(abs(e.freq_hz - hz) < 2e-3 * hz for e in find_lines(record(values + line, rate), band))


def removal() -> Iterator[str]:
    yield "| record | line Hz | speed | line dB | what is left, dB | modes changed by, dB |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for name, (factor, rate, seconds) in RECORDS.items():
        for hz in (10.7 * factor, 14.2 * factor):
            for wander in (0.0, WANDER):
                for db in (-10, 10, 30):
                    values, line = _with_line(1, factor, rate, seconds, hz, db, wander)
                    clean, _ = without_lines(record(values + line, rate), [hz])
                    rest = 20.0 * np.log10((clean.values - values).std() / values.std())
                    word = "wanders" if wander else "constant"
                    yield f"| {name} | {hz:.4g} | {word} | {db} | {rest - db:.0f} | {rest:.0f} |"


def critical() -> None:
    """Quantiles of the two measures for the envelope of a mode with the damping that counts as the least."""
    rng = np.random.default_rng(0)
    for a in (0.5, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512):
        segments, points = max(8.0, a * 2.0 * WANDER / (np.pi * LEAST_DAMPING)), 16
        samples = int(segments * points)
        paths, hop, window = int(min(20_000, 4e7 / samples)), points // 4, np.hanning(points + 2)[1:-1]
        keep = np.exp(-a / segments / points)
        both = []
        for _ in range(10):
            noise = rng.standard_normal((2, paths // 10, samples))
            white = (noise[0] + 1j * noise[1]) * np.sqrt(1.0 - keep**2)
            white[:, 0] /= np.sqrt(1.0 - keep**2)
            path = lfilter([1.0], [1.0, -keep], white, axis=1)
            starts = range(0, samples - points + 1, hop)
            z = np.stack([(path[:, s : s + points] * window).sum(axis=1) for s in starts], axis=1)
            size = np.abs(z) ** 2
            steady = (np.abs(np.fft.fft(z, 8 * z.shape[1], axis=1)) ** 2).max(axis=1) / z.shape[1] / size.sum(axis=1)
            both.append((size.var(axis=1) / size.mean(axis=1) ** 2, 1.0 - steady))
        envelope, rest = (np.concatenate(part) for part in zip(*both))
        print(f"{a:6g} {paths:6d} {np.quantile(envelope, 1e-3):.3f} {np.quantile(rest, 1e-3):.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--critical", action="store_true")
    parser.add_argument("--evidence", type=Path, default=Path("docs/evidence"))
    options = parser.parse_args()
    if options.critical:
        critical()
        return
    text = f"""# Harmonics in output-only records

Measured on {datetime.now(UTC):%Y-%m-%d} by `benchmarks/identification/harmonics.py`: six
channels, five modes under white forces, 2 % of noise. Levels of lines are relative to the rms of all modes together.

## Modes called harmonics

No harmonic is in these records; each has five modes with the same damping ratio.

{chr(10).join(level(5 * options.records))}

## Harmonics found

Modes with 0.8 to 1.5 % of damping; share of {options.records} records in which the line is found. A speed
that wanders deviates by up to {100.0 * WANDER:g} % from its mean. On a mode, a line of −20 dB is weaker than
the response of the mode within the bandwidth that the duration of the record resolves.

{chr(10).join(power(options.records))}

## Lines subtracted

What `remove_hz` leaves, relative to the line, and the difference from the record without a line, relative to the modes.

{chr(10).join(removal())}
"""
    (options.evidence / "benchmark_harmonics.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
