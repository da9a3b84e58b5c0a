"""Refined modes of ambient records where the model of their spectra is wrong: ambient_doubts.py [--records N].

Four modes at five channels, 300 s; each kind of record is drawn N times, and identified by SSI-cov without and with the
refinement by maximum likelihood.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.identification.harmonics import find_lines
from femtune.identification.operational import Operational, by_covariances, prepared
from femtune.identification.refined import refined
from femtune.modal import Channel, TimeSeries

Reals = NDArray[np.float64]
RATE, SECONDS, BAND = 40.0, 300.0, (0.8, 15.0)
FREQ = np.array([1.7, 3.9, 4.6, 9.0])
RATIO = np.array([0.012, 0.01, 0.015, 0.008])
KINDS = ("as the model", "load in f^-2", "load with a peak", "complex shapes", "bursts", "level times ten",
         "line at a mode", "line beside a mode", "frequencies drift 1 %", "short, 60 s")  # fmt: skip


def simulated(kind: str, seed: int) -> TimeSeries:
    """A record of accelerations, by exact steps of each mode over many samples of the force."""
    rng = np.random.default_rng([5, seed])
    shapes = rng.uniform(0.3, 1.0, (5, 4)) * rng.choice((-1.0, 1.0), (5, 4)) + 0j
    if kind == "complex shapes":
        shapes *= np.exp(1j * rng.uniform(-0.5, 0.5, (5, 4)))
    seconds = 60.0 if kind == "short, 60 s" else SECONDS
    count = round((seconds + 60.0) * RATE)
    force = rng.standard_normal((6, count))
    t = np.arange(count) / RATE
    if kind == "bursts":
        force *= (np.random.default_rng([6, seed]).random(count // 40 + 1).repeat(40)[:count] < 0.1) * 3.0 + 0.1
    if kind == "level times ten":
        force *= np.where(t < 60.0 + 0.8 * seconds, 1.0, 10.0)
    hz = np.fft.rfftfreq(count, 1.0 / RATE)
    load = np.ones(len(hz))
    if kind == "load in f^-2":
        load = 1.0 / np.maximum(hz, 0.3) ** 2
    if kind == "load with a peak":
        load = 1.0 + 4.0 / (1.0 + ((hz - 4.2) / 0.6) ** 2)
    modal = rng.standard_normal((4, 6)) @ (np.fft.rfft(force) * load)
    w, own = 2.0 * np.pi * hz, 2.0 * np.pi * FREQ[:, None]
    motion = np.zeros((5, count))
    parts = 8 if kind == "frequencies drift 1 %" else 1
    for part in range(parts):
        moved = own * (1.0 + (0.0 if parts == 1 else 0.01 * (part / (parts - 1) - 0.5)))
        h = -(w**2) / (moved**2 - w**2 + 2j * RATIO[:, None] * moved * w)
        one = np.fft.irfft(shapes @ (h * modal), count)
        inside = (np.arange(count) * parts // count) == part
        motion[:, inside] = one[:, inside]
    motion = motion[:, round(60.0 * RATE) :]
    line_hz = {"line at a mode": 3.9, "line beside a mode": 4.1}.get(kind)
    if line_hz:
        motion = motion + motion.std(axis=1, keepdims=True) * np.sin(2.0 * np.pi * line_hz * t[: motion.shape[1]])
    motion += 0.03 * motion.std(axis=1, keepdims=True) * rng.standard_normal(motion.shape)
    return TimeSeries(motion, [Channel(Dof(i + 1, "Z")) for i in range(5)], sampling_hz=RATE)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--kinds", nargs="*", default=KINDS, choices=KINDS)
    options = parser.parse_args()
    asked = Operational(BAND, 60)
    print("| record | modes | refined | frequency | damping | 95 % before, frequency | damping | after, frequency "
          "| damping |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |")  # fmt: skip
    for kind in options.kinds:
        before, after, count = [], [], 0
        for seed in range(options.records):
            record = simulated(kind, seed)
            found = by_covariances(record, asked)
            ready = prepared(record, asked)
            lines = find_lines(ready, BAND, found.modes.freq_hz.tolist())
            keep = tuple(
                replace(c, chosen=False) if any(abs(c.freq_hz - one.freq_hz) <= one.width_hz
                and c.damping_ratio * c.freq_hz <= one.width_hz for one in lines) else c for c in found.candidates
            )  # fmt: skip
            found = replace(found, candidates=keep, modes=found.modes.select_modes(_chosen(found.candidates, keep)),
                            complex_shapes=found.complex_shapes[:, _chosen(found.candidates, keep)])  # fmt: skip
            other = refined(found, ready, lines, asked)
            a, b = found.modes, other.modes.modes
            for f, z in zip(FREQ, RATIO):
                near = [np.flatnonzero(np.abs(m.freq_hz / f - 1.0) < 0.02) for m in (a, b)]
                if any(len(n) != 1 for n in near):
                    continue
                rows = [
                    ((m.freq_hz[i] - f) / f, (m.damping_ratio[i] - z) / z, m.freq_sd_hz[i] / f, m.damping_sd[i] / z)
                    for m, i in ((a, near[0][0]), (b, near[1][0]))
                ]
                before.append(rows[0])
                after.append(rows[1])
                count += int(near[1][0]) in other.positions
        x, y = np.array(before), np.array(after)
        rms = [np.sqrt(np.mean(y[:, k] ** 2) / np.mean(x[:, k] ** 2)) for k in (0, 1)]
        inside = [100.0 * np.mean(np.abs(v[:, k]) <= 1.96 * v[:, k + 2]) for v in (x, y) for k in (0, 1)]
        print(f"| {kind} | {len(x)} | {count} | {rms[0]:.2f} | {rms[1]:.2f} | "
              + " | ".join(f"{v:.0f} %" for v in inside) + " |", flush=True)  # fmt: skip


def _chosen(before: tuple, after: tuple) -> list[int]:
    """Positions among the modes of those that are still chosen."""
    return [i for i, c in enumerate(c for old, c in zip(before, after) if old.chosen) if c.chosen]


if __name__ == "__main__":
    main()
