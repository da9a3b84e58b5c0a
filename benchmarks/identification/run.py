"""Identification beside pyOMA2, koma and sdypy-EMA on the same records: run.py [--quick] [--evidence DIR].

Bias and scatter of frequencies, damping and shapes from measured functions and from ambient records of a plate with 56
sensors, three pairs of close modes and 0.1 to 5 % damping; then how long everybody takes. Modes are chosen among the
poles of all by the same rule. Peers that are not installed are left out; `make bench-identification` installs them
aside.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))  # where structures/ lies

import numpy as np
import peers
import plates
from numpy.typing import NDArray

from femtune.identification import InputKnown, Limits, choose, chosen_poles, identify_frfs
from femtune.identification.n4sid import n4sid_poles, subspace
from femtune.identification.operational import Operational, by_covariances
from femtune.identification.plscf import normal_equations, plscf_poles
from femtune.identification.pole_table import PoleTable
from femtune.identification.ssi import covariance_driven
from femtune.modal import FrfSet, ModeSet, TimeSeries
from femtune.modal.shape_criteria import mac

BAND = (4.0, 60.0)
REFERENCES = [0, 11, 26, 41]
ROWS = 20
TURNS = 3

Found = tuple[NDArray, NDArray, NDArray]
"""Frequencies, damping ratios, shapes."""


@dataclass(frozen=True)
class Size:
    """Seeds, seconds of ambient record and its channels, and what the timing is done with."""

    seeds: int
    ambient_s: float
    lines: int
    long_samples: int
    largest: int


QUICK, FULL = Size(2, 120.0, 800, 40_000, 40), Size(6, 600.0, 3000, 480_000, 100)


def of_table(table: PoleTable) -> Found:
    """The modes that the common rule chooses."""
    chosen = chosen_poles(choose(table, Limits(band_hz=BAND)), table)
    return chosen.freq_hz, chosen.damping_ratio, chosen.shapes


def of_modes(modes: ModeSet) -> Found:
    """Modes as they are."""
    assert modes.damping_ratio is not None
    return modes.freq_hz, modes.damping_ratio, modes.shapes


def ways_of_functions() -> dict[str, Callable[[FrfSet], Found]]:
    """Who identifies from functions."""
    ways: dict[str, Callable[[FrfSet], Found]] = {
        "femtune, N4SID and pLSCF with fit": lambda f: of_modes(identify_frfs(f, InputKnown(BAND, 40)).modes),
        "femtune, N4SID poles": lambda f: of_table(n4sid_poles(subspace(f, 40), range(2, 41, 2))),
        "femtune, pLSCF poles": lambda f: of_table(plscf_poles(normal_equations(f, 40), range(2, 41))),
    }
    if peers.installed("sdypy.EMA"):
        ways["sdypy-EMA, LSCF"] = lambda f: of_table(peers.ema_lscf(f, 80))
    return ways


def ways_of_records() -> dict[str, Callable[[TimeSeries], Found]]:
    """Who identifies from responses alone."""
    ways: dict[str, Callable[[TimeSeries], Found]] = {"femtune, SSI-cov": _ssi}
    if peers.installed("pyoma2"):
        ways["pyOMA2, SSI-cov"] = lambda r: of_table(peers.pyoma2_ssi(r, REFERENCES, ROWS, 40))
    if peers.installed("koma"):
        ways["koma, SSI-cov"] = lambda r: of_table(peers.koma_ssi(r, ROWS, 40))
    return ways


def _ssi(record: TimeSeries) -> Found:
    asked = Operational(BAND, 40, references=record.dofs().select(REFERENCES), block_rows=ROWS)
    return of_modes(by_covariances(record, asked).modes)


@dataclass(frozen=True)
class Score:
    """Worst relative bias and scatter of frequencies and damping over the modes, worst MAC, modes missed and extra."""

    freq_bias: float
    freq_scatter: float
    damping_bias: float
    damping_scatter: float
    mac: float
    missed: float
    extra: float


def score(truth: ModeSet, found: Sequence[Found]) -> Score:
    """Over all seeds; modes are matched by nearness and shape."""
    assert truth.damping_ratio is not None
    m = len(truth)
    freq, damping, like = np.full((3, len(found), m), np.nan)
    extra = 0
    for s, (f, z, shapes) in enumerate(found):
        alike = mac(shapes, truth.shapes) if len(f) else np.zeros((0, m))
        near = np.abs(f[:, None] / truth.freq_hz - 1.0) if len(f) else np.zeros((0, m))
        cost = np.where((near < 0.05) & (alike > 0.5), near + 1.0 - alike, np.inf)
        taken = set()
        for j in range(m):
            if len(f) and np.isfinite(cost[:, j]).any():
                i = int(cost[:, j].argmin())
                taken.add(i)
                freq[s, j], damping[s, j] = f[i] / truth.freq_hz[j] - 1.0, z[i] / truth.damping_ratio[j] - 1.0
                like[s, j] = alike[i, j]
        extra += len(f) - len(taken)
    with np.errstate(all="ignore"):
        return Score(
            _worst(np.abs(_mean(freq))), _worst(_sd(freq)), _worst(np.abs(_mean(damping))), _worst(_sd(damping)),
            float(np.nanmin(like, initial=1.0)), float(np.isnan(freq).sum() / len(found)), extra / len(found),
        )  # fmt: skip


def _mean(values: NDArray) -> NDArray:
    known = np.isfinite(values)
    return np.where(known, values, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)


def _sd(values: NDArray) -> NDArray:
    away = np.where(np.isfinite(values), values - _mean(values), 0.0)
    return np.sqrt((away**2).sum(axis=0) / np.maximum(np.isfinite(values).sum(axis=0) - 1, 1))


def _worst(values: NDArray) -> float:
    return float(values.max())


def accuracy(size: Size) -> list[str]:
    """Rows of the table, functions and records at three levels of noise."""
    rows = []
    truth = plates.plate().truth
    for noise in (20.0, 40.0, 60.0):
        tests = [plates.measured_functions(noise, seed, size.lines) for seed in range(size.seeds)]
        rows += _rows(f"functions, {noise:.0f} dB", truth, ways_of_functions(), tests)
        records = [plates.ambient_record(56, size.ambient_s, noise, seed) for seed in range(size.seeds)]
        rows += _rows(f"ambient {size.ambient_s:.0f} s, {noise:.0f} dB", truth, ways_of_records(), records)
    return rows


def _rows(what: str, truth: ModeSet, ways: dict[str, Callable[..., Found]], tests: Sequence[object]) -> list[str]:
    rows = []
    for name, way in ways.items():
        one = score(truth, [way(test) for test in tests])
        numbers = (one.freq_bias, one.freq_scatter, one.damping_bias, one.damping_scatter)
        cells = " | ".join(f"{100 * n:.3f}" if k < 2 else f"{100 * n:.1f}" for k, n in enumerate(numbers))
        rows.append(f"| {what} | {name} | {cells} | {one.mac:.4f} | {one.missed:.1f} | {one.extra:.1f} |")
        print(rows[-1], flush=True)
    return rows


def speed(size: Size) -> list[str]:
    """Seconds of each way in this run, and as parts of femtune's."""
    frfs = plates.measured_functions(40.0, 0, size.lines)
    record = plates.ambient_record(8, size.long_samples / 150.0, 40.0, 0)
    all_orders = range(2, size.largest + 1, 2)
    four = [0, 1, 2, 3]
    jobs: list[tuple[str, dict[str, Callable[[], object]]]] = [
        (f"56 × {size.lines} functions, order 40, all poles with shapes", {
            "femtune, N4SID": lambda: n4sid_poles(subspace(frfs, 40), range(2, 41, 2)),
            "femtune, pLSCF": lambda: plscf_poles(normal_equations(frfs, 40), range(2, 41, 2)),
            **({"sdypy-EMA, LSCF": lambda: peers.ema_lscf(frfs, 40)} if peers.installed("sdypy.EMA") else {}),
        }),
        (f"8 × {record.samples} samples, SSI-cov up to order 40", _of_records(record, four, 40)),
        (f"the same, stabilisation up to order {size.largest}", _of_records(record, four, size.largest)),
        (f"56 × {size.lines} functions, stabilisation up to order {size.largest}", {
            "femtune, N4SID": lambda: n4sid_poles(subspace(frfs, size.largest), all_orders),
            "femtune, pLSCF": lambda: plscf_poles(normal_equations(frfs, size.largest), all_orders),
        }),
    ]  # fmt: skip
    return [row for what, ways in jobs for row in _timed(what, ways)]


def _of_records(record: TimeSeries, references: list[int], order: int) -> dict[str, Callable[[], object]]:
    rows = max(ROWS, -(-6 * order // (5 * len(references))))
    dofs = record.dofs().select(references)
    asked = Operational(BAND, order, references=dofs, block_rows=rows)
    ways: dict[str, Callable[[], object]] = {
        "femtune": lambda: _poles_only(record, references, rows, order),
        "femtune, modes chosen, with standard deviations": lambda: by_covariances(record, asked),
    }
    if peers.installed("pyoma2"):
        ways["pyOMA2"] = lambda: peers.pyoma2_ssi(record, references, rows, order)
    if peers.installed("koma"):
        ways["koma"] = lambda: peers.koma_ssi(record, rows, order)
    return ways


def _poles_only(record: TimeSeries, references: list[int], rows: int, order: int) -> object:
    values = record.values - record.values.mean(axis=1, keepdims=True)
    model = covariance_driven(values, 1.0 / record.even_hz, references, rows, order, blocks=2)
    return list(model.observability.poles(range(2, order + 1, 2)))


def _timed(what: str, ways: dict[str, Callable[[], object]]) -> list[str]:
    seconds = dict.fromkeys(ways, np.inf)
    # in turns, so that other work of the machine slows all of them down alike
    for _ in range(TURNS):
        for name, way in ways.items():
            begun = time.process_time()
            way()
            seconds[name] = min(seconds[name], time.process_time() - begun)
    first = next(iter(seconds.values()))
    rows = [f"| {what} | {name} | {each:.2f} | {each / first:.1f} |" for name, each in seconds.items()]
    print(*rows, sep="\n", flush=True)
    return rows


def page(size: Size) -> str:
    """Both tables."""
    return "\n".join([
        "# Identification beside its peers", "",
        "A simply supported plate with 56 sensors and eight modes of 8 to 52 Hz, three pairs of them 0.6 to 1.3 % "
        f"apart, with damping from 0.1 to 5 %; {size.seeds} tests of each kind with noise of their own. The poles of "
        "all libraries went through the same choice of modes. Worst over the modes; frequencies and damping relative "
        "to the truth.", "",
        "| test | way | bias of f % | scatter of f % | bias of ζ % | scatter of ζ % | worst MAC | missed | extra |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |", *accuracy(size), "",
        "## Time", "",
        f"Seconds of the processor with one thread, the least of {TURNS} runs in which all take turns, and relative to "
        "those of the first row. All libraries work on the same arrays.", "",
        "| work | way | s | ratio |", "| --- | --- | --- | --- |", *speed(size), "",
    ])  # fmt: skip


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a smaller form")
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    options = parser.parse_args()
    text = page(QUICK if options.quick else FULL)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "benchmark_identification.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
