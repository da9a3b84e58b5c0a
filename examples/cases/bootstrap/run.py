"""Bootstrap of FRFs against Monte Carlo, and coverage of its intervals: python run.py [--quick] [--evidence DIR].

A plane free frame with four unknown moduli and 2 % damping, tested with two inputs and fourteen outputs. The standard
deviations that a bootstrap finds in one test are compared with the scatter of the calibrations of many tests. The full
form takes about ten minutes of processor time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from scipy.stats import binom, chi2

from femtune.arrays import Reals
from femtune.executor import Executor, Processes, Serial
from femtune.uncertainty import BootstrapResult, bootstrap_result
from structures.cross_frame import GROUPS, TRUTH, Campaign, Campaigns

LEVEL = 0.95


@dataclass(frozen=True)
class Size:
    """Data sets with a bootstrap, runs of each, tests of the Monte Carlo, tests of the coverage; of equal weights too.

    `within` is the largest difference of the mean standard deviations from those of the Monte Carlo, `lower` and
    `upper` limit the coverage.
    """

    sets: int
    runs: int
    tests: int
    coverage: int
    equal_sets: int
    equal_runs: int
    equal_tests: int
    within: float
    lower: float
    upper: float


def by_chance(tests: int) -> tuple[float, float]:
    """The band that an honest interval leaves less than once in ten thousand."""
    return binom.ppf(5e-5, tests, LEVEL) / tests, binom.ppf(1 - 5e-5, tests, LEVEL) / tests


QUICK = Size(1, 20, 16, 8, 1, 5, 5, 0.9, *by_chance(8))
FULL = Size(10, 1000, 1000, 2000, 2, 100, 120, 0.15, 0.93, 0.97)


@dataclass(frozen=True, eq=False)
class Found:
    """Bootstraps and Monte Carlo of one weighting."""

    campaigns: Campaigns
    tests: Sequence[Campaign]
    bootstraps: Sequence[BootstrapResult]

    @property
    def monte_carlo(self) -> Reals:
        """(4,) scatter of the calibrations of all tests."""
        return np.std([t.x for t in self.tests], axis=0, ddof=1)

    @property
    def error(self) -> Reals:
        """(4,) mean error of the calibrations in their standard deviations."""
        return (np.mean([t.x for t in self.tests], axis=0) - TRUTH) / self.monte_carlo

    @property
    def sd(self) -> Reals:
        """(sets, 4) standard deviations of the bootstraps."""
        return np.array([b.samples.std(axis=0, ddof=1) for b in self.bootstraps])

    def mean(self, name: str) -> Reals:
        """(4,) mean of a field over all tests."""
        return np.mean([getattr(t, name) for t in self.tests], axis=0)


def compare(workers: Executor, campaigns: Campaigns, sets: int, runs: int, tests: int) -> Found:
    """Bootstraps of the first tests, and all tests."""
    every = workers.run(campaigns, range(tests), name="test")
    print(f"  {tests} tests", flush=True)
    results = []
    for seed in range(sets):
        work = campaigns.bootstrap(seed, runs=runs)
        check = [work.check(i) for i in range(min(20, runs))] if seed == 0 else []
        results.append(bootstrap_result(work, workers.run(work, range(runs)), check))
        print(f"  data set {seed + 1} of {sets}", flush=True)
    return Found(campaigns, every, results)


def study(size: Size) -> tuple[Found, Found, Reals]:
    """Noise weights and equal weights; coverage of the intervals with noise weights; asserted."""
    # a worker takes longer to start than the few runs of the quick form
    workers = Serial() if size is QUICK else Processes()
    weighted = compare(workers, Campaigns(), size.sets, size.runs, size.tests)
    ratio = weighted.sd.mean(axis=0) / weighted.monte_carlo
    print("noise weights:", ratio, flush=True)
    assert (np.abs(ratio - 1.0) <= size.within).all(), ratio
    difference = weighted.bootstraps[0].difference
    assert difference is not None
    assert difference < 0.1
    more = workers.run(replace(Campaigns(), in_band=2), range(size.coverage), name="test")
    coverage = np.mean([(t.lower <= TRUTH) & (t.upper >= TRUTH) for t in more], axis=0)
    print("coverage:", coverage, flush=True)
    assert (coverage >= size.lower).all(), coverage
    assert (coverage <= size.upper).all(), coverage
    equal = compare(workers, Campaigns(weighted=False), size.equal_sets, size.equal_runs, size.equal_tests)
    print("equal weights:", equal.sd.mean(axis=0) / equal.monte_carlo, flush=True)
    # noise weights are what makes the calibration sharp
    assert (equal.monte_carlo > 3.0 * weighted.monte_carlo).all()
    return weighted, equal, coverage


def rows(found: Found) -> list[str]:
    """A row each parameter."""
    scale = 1e5
    out = []
    sd, carlo, error = found.sd, found.monte_carlo, found.error
    fisher, lines, entries = (found.mean(name) for name in ("fisher_sd", "lines_sd", "entries_sd"))
    for i, name in enumerate(GROUPS):
        mean = sd[:, i].mean()
        spread = f"{sd[:, i].min() / carlo[i]:.2f} to {sd[:, i].max() / carlo[i]:.2f}"
        out.append(
            f"| {name} | {scale * carlo[i]:.2f} | {scale * mean:.2f} | **{mean / carlo[i]:.2f}** | {spread} | "
            f"{lines[i] / carlo[i]:.2f} | {entries[i] / carlo[i]:.2f} | {fisher[i] / carlo[i]:.2f} | {error[i]:+.2f} |"
        )
    return out


def text(weighted: Found, equal: Found, coverage: Reals, size: Size) -> str:
    """The page."""
    head = (
        "| parameter | Monte Carlo σ, 1e-5 | bootstrap σ, 1e-5 | ratio | single data sets | lines, "
        "linearised | entries, linearised | Fisher | mean error / σ |\n" + "| --- " * 9 + "|"
    )
    first = weighted.bootstraps[0]
    lines = len(weighted.campaigns.exact.freq_hz)
    few = len(replace(weighted.campaigns, in_band=2).exact.freq_hz)
    known = 100.0 * float(np.sqrt(chi2.var(size.tests - 1)) / (2.0 * (size.tests - 1)))
    covered = ", ".join(f"{name} {100.0 * c:.1f} %" for name, c in zip(GROUPS, coverage))
    return "\n".join([
        "# Bootstrap of FRFs against Monte Carlo", "",
        "A plane, free steel frame (1.0 × 0.6 m with a cross bar, bars 20 × 12 mm) is calibrated by its accelerances: "
        "moduli of four groups of bars, two inputs, fourteen outputs, 20 to 420 Hz, 2 % damping, three lines in a "
        f"half-power bandwidth ({lines} lines), 40 modes on both sides. The noise of real and imaginary part is "
        f"{100.0 * weighted.campaigns.floor:g} % of the largest magnitude of each FRF. The true values are +12, −10, "
        "+8 and −15 % from the nominal ones.", "",
        f"**Monte Carlo**: {size.tests} simulated tests, each calibrated anew; the standard deviations are known to "
        f"{known:.1f} %. **Bootstrap**: {size.sets} of these tests, {size.runs} runs each over frequency lines, with "
        "shared derivatives. The columns \"linearised\" and \"Fisher\" are means over all tests, relative to the Monte "
        "Carlo.", "",
        "## Residual weighted by the noise", "", head, *rows(weighted), "",
        f"Required: ratios of the means within {100.0 * size.within:.0f} % of 1. The scatter of single data sets is "
        "that of an estimate from the few lines near resonances that carry the information; all FRFs of a line are "
        "drawn together. Twenty runs with derivatives at every point differ from those with shared derivatives by at "
        f"most {first.difference:.3f} σ (required: 0.1).", "",
        "## Equal weights", "",
        "The logarithm of the ratio with equal weights at all lines, as in the subframe studies: antiresonances, "
        f"where noise dominates, have the same weight as resonances. {size.equal_tests} tests, {size.equal_sets} "
        f"bootstraps of {size.equal_runs} runs.", "",
        head, *rows(equal), "",
        f"The scatter is {np.median(equal.monte_carlo / weighted.monte_carlo):.0f} times as large (median), and the "
        "mean error shows the bias by antiresonances.", "",
        "## Coverage", "",
        f"{size.coverage} further simulated tests with two lines in a bandwidth ({few} lines): each is calibrated, its "
        "residuals and derivatives are computed anew, and its 95 % interval is that of 1000 first Gauss-Newton steps "
        f"over frequency lines. They contain the true value in: {covered}. Required: {100.0 * size.lower:.0f} to "
        f"{100.0 * size.upper:.0f} %.", "",
    ])  # fmt: skip


def main() -> None:
    """Run the example."""
    options = argparse.ArgumentParser()
    options.add_argument("--quick", action="store_true")
    options.add_argument("--evidence", type=Path)
    asked = options.parse_args()
    size = QUICK if asked.quick else FULL
    page = text(*study(size), size)
    print(page)
    if asked.evidence:
        (asked.evidence / "cases_bootstrap.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
