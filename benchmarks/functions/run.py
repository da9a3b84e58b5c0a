"""Identification from functions beside sdypy-EMA on the same noise: python benchmarks/functions/run.py [--quick].

56 responses to one shaker, 3000 lines, six modes between 12 and 90 Hz; bias and scatter over seeds. sdypy-EMA (`pip
install sdypy-EMA`) is told the true frequencies, of which it takes the nearest stable poles, since it leaves the choice
to the eye; femtune is told the band. Where it is not installed its rows are left out.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from femtune.dofs import DofSet
from femtune.identification import InputKnown, identify_frfs
from femtune.modal import FrfSet, ModeSet, mac, pole_of

LINES = np.linspace(5.0, 105.0, 3000)
STRUCTURES = {
    "apart, 0.1 to 5 %": ((12.0, 20.0, 30.0, 55.0, 72.0, 90.0), (0.001, 0.05, 0.02, 0.003, 0.03, 0.01)),
    "two 0.5 % apart": ((12.0, 20.0, 20.1, 55.0, 72.0, 90.0), (0.01, 0.002, 0.002, 0.003, 0.005, 0.01)),
}
WINDOW_HZ = 2.0
"""On either side of each true frequency, where sdypy-EMA looks for the stable pole: its smallest window."""
Found = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Frequencies, damping ratios, shapes."""


@dataclass(frozen=True, eq=False)
class Row:
    """One method on one structure at one noise level, all seeds; errors of modes found (MAC above 0.8, within 1 %)."""

    structure: str
    decibel: int
    way: str
    found: float
    extra: float
    freq_bias: float
    freq_scatter: float
    damping_bias: float
    damping_scatter: float
    shape_error: float
    seconds: float

    def text(self) -> str:
        """A row of the table."""
        numbers = (
            self.freq_bias, self.freq_scatter, self.damping_bias, self.damping_scatter, self.shape_error, self.seconds,
        )  # fmt: skip
        cells = [f"{x:.1e}" if np.isfinite(x) else "–" for x in numbers[:5]]
        first = f"| {self.structure} | {self.decibel} | {self.way} | {self.found:.2f} | {self.extra:.2f} |"
        return f"{first} {' | '.join(cells)} | {self.seconds:.2f} |"


def truth_of(structure: str, channels: int) -> ModeSet:
    """Mass-normalised modes with shapes of normal random numbers."""
    freq, damping = (np.array(x) for x in STRUCTURES[structure])
    shapes = np.random.default_rng(5).standard_normal((channels, len(freq)))
    dofs = DofSet.parse(f"{i + 1}Z+" for i in range(channels))
    return ModeSet(freq, shapes, dofs, damping_ratio=damping, normalisation="mass")


def functions(truth: ModeSet, decibel: int, seed: int) -> tuple[FrfSet, np.ndarray]:
    """Accelerances of a shaker at the first response, with noise so far below their rms, and its standard deviation."""
    assert truth.damping_ratio is not None
    poles, s = pole_of(truth.freq_hz, truth.damping_ratio), 2j * np.pi * LINES[:, None]
    residues = truth.shapes * truth.shapes[0] / (2j * poles.imag)
    values = (residues @ (1.0 / (s - poles)).T + residues.conj() @ (1.0 / (s - poles.conj())).T) * s[:, 0] ** 2
    level = 10.0 ** (-decibel / 20.0) * np.sqrt(np.mean(np.abs(values) ** 2))
    rng = np.random.default_rng(seed)
    error = rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)
    noisy = (values + level / np.sqrt(2.0) * error)[:, None]
    return FrfSet(LINES, noisy, truth.dofs, truth.dofs.select([0]), "accelerance"), np.full(noisy.shape, level)


def by_femtune(frfs: FrfSet, sd: np.ndarray, truth: ModeSet) -> Found:
    """N4SID and pLSCF, the choice, the fit."""
    del truth
    modes = identify_frfs(frfs, InputKnown(largest_order=60), sd).modes
    assert modes.damping_ratio is not None
    return modes.freq_hz, modes.damping_ratio, modes.shapes


def by_sdypy(frfs: FrfSet, sd: np.ndarray, truth: ModeSet) -> Found:
    """LSCF to the same degree, the poles nearest to the truth, residues by LSFD."""
    del sd
    from sdypy import EMA  # noqa: PLC0415

    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter("ignore")
        model = EMA.Model(
            frf=frfs.values[:, 0], freq=frfs.freq_hz, lower=LINES[0], upper=LINES[-1], pol_order_high=60,
            frf_form="accelerance",
        )  # fmt: skip
        model.get_poles(method="lscf", show_progress=False)
        # its window is 50 Hz unless one says otherwise, and would hold several modes
        model.select_closest_poles(list(truth.freq_hz), f_window=WINDOW_HZ)
        shapes = np.asarray(model.get_constants()[1])[:, : len(truth)]
    return np.asarray(model.nat_freq), np.asarray(model.nat_xi), shapes


def ways() -> dict[str, Callable[[FrfSet, np.ndarray, ModeSet], Found]]:
    """Those at hand."""
    try:
        import sdypy.EMA  # noqa: F401, PLC0415
    except ImportError:
        return {"femtune": by_femtune}
    return {"femtune": by_femtune, "sdypy-EMA": by_sdypy}


def measured(structure: str, decibel: int, way: str, channels: int, seeds: int) -> Row:
    """Run a way over all seeds."""
    truth = truth_of(structure, channels)
    freq, damping, shape, counts, extra, seconds = [], [], [], [], [], []
    for seed in range(seeds):
        frfs, sd = functions(truth, decibel, seed)
        begin = time.process_time()
        found = ways()[way](frfs, sd, truth)
        seconds.append(time.process_time() - begin)
        rows = errors(found, truth)
        freq.append(rows[0])
        damping.append(rows[1])
        shape.append(rows[2])
        counts.append(np.isfinite(rows[0]).sum())
        extra.append(len(found[0]) - counts[-1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return Row(
            structure, decibel, way, float(np.mean(counts)), float(np.mean(extra)), *_bias_and_scatter(freq),
            *_bias_and_scatter(damping), float(np.nanmedian(shape)), float(np.median(seconds)),
        )  # fmt: skip


def errors(found: Found, truth: ModeSet) -> np.ndarray:
    """(3, m) relative errors of frequency and damping, and 1 − MAC; NaN where a mode was not found."""
    assert truth.damping_ratio is not None
    freq, damping, shapes = found
    out = np.full((3, len(truth)), np.nan)
    if not len(freq):
        return out
    like = mac(truth.shapes, shapes)
    for r in range(len(truth)):
        near = np.where(np.abs(freq / truth.freq_hz[r] - 1.0) < 0.01, like[r], 0.0)
        i = int(np.argmax(near))
        if near[i] > 0.8:
            out[:, r] = freq[i] / truth.freq_hz[r] - 1.0, damping[i] / truth.damping_ratio[r] - 1.0, 1.0 - like[r, i]
    return out


def _bias_and_scatter(rows: list[np.ndarray]) -> tuple[float, float]:
    """Root mean square over modes of the mean over seeds, and of the standard deviation."""
    every = np.array(rows)
    return float(np.sqrt(np.nanmean(np.nanmean(every, axis=0) ** 2))), float(
        np.sqrt(np.nanmean(np.nanvar(every, axis=0)))
    )


def page(rows: list[Row], channels: int, seeds: int) -> str:
    """The page."""
    return "\n".join(
        [
            "# Identification from functions, beside a peer",
            "",
            f"{channels} responses to one shaker, {len(LINES)} lines, six modes, {seeds} seeds. Bias and "
            "scatter are relative, root mean squares over the modes that were found; 1 − MAC is the median. sdypy-EMA "
            "is told the true frequencies and looks 2 Hz about them, its smallest window; femtune chooses by itself, "
            "and its time has the fit with standard deviations and the state-space model in it. Seconds are of the "
            "processor.",
            "",
            "| modes | dB | | found of 6 | others | Hz bias | Hz scatter | ζ bias | ζ scatter | 1 − MAC | s |",
            "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
            *(row.text() for row in rows),
            "",
        ]
    )


def main() -> None:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="16 channels, two seeds, one noise")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--evidence", type=Path, help="folder for the documentation's page")
    options = parser.parse_args()
    channels, seeds, noises = (16, 2, (40,)) if options.quick else (56, options.seeds, (20, 40, 60))
    rows = [measured(s, d, w, channels, seeds) for s in STRUCTURES for d in noises for w in ways()]
    assert all(r.found == len(STRUCTURES[r.structure][0]) for r in rows if r.way == "femtune" and r.decibel >= 40)
    text = page(rows, channels, seeds)
    print(text)
    if options.evidence:
        (options.evidence / "benchmark_functions.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
