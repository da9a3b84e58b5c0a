"""Coverage of 95 % intervals beside active bounds: python run.py [--quick] [--evidence DIR].

Simulated tests of problems with known parameters. The true values are drawn from the prior that the intervals assume:
uniform between the bounds, or normal and truncated to the bounds. Most tests leave some parameters on a bound, because
the data are weak. The first four problems are linear, so that the assumption of the intervals is met; the last one
updates a chain of springs by identified shapes with the standard deviations of their entries.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from scipy.stats import binom, norm

from femtune.arrays import Flags, Reals
from femtune.updating import update
from structures.bounded import (
    PROBLEMS,
    BoundedProblem,
    BoundedTest,
    bounded_test,
    first_at,
    shapes_with_deviations,
)

LEVEL = 0.95
LOWER, UPPER = 0.93, 0.97
LEAST, FEW = 20, 4
"""Tests in a row of the table, at least; tests of each problem in the quick form."""


@dataclass(frozen=True)
class Covered:
    """Of many tests: which intervals hold the truth, by this method and with bounded parameters taken as known."""

    name: str
    words: str
    held: Flags
    held_if_known: Flags
    on_bound: Flags
    lowest: float

    def rows(self) -> list[str]:
        """Rows of the table: all tests, and tests with none, one and half of the parameters on a bound."""
        counts = self.on_bound.sum(axis=1)
        half = self.held.shape[1] // 2
        groups = {
            "all": np.ones(len(counts), bool),
            "none": counts == 0,
            "one": counts == 1,
            f"half ({half})": counts == half,
        }
        return [self._row(words, at) for words, at in groups.items() if words == "all" or at.sum() >= LEAST]

    def _row(self, words: str, at: Flags) -> str:
        held = 100.0 * self.held[at].mean()
        # the old rule gives no interval for a parameter on a bound
        inside = ~self.on_bound[at]
        old = 100.0 * self.held_if_known[at][inside].mean() if inside.any() else np.nan
        return f"| {self.name} | {words} | {at.sum()} | {held:.1f} | {old:.1f} |"

    def coverage(self, count: int | None = None) -> tuple[float, int]:
        """Coverage, and the number of tests, of all or with a number of parameters on bounds."""
        counts = self.on_bound.sum(axis=1)
        at = np.ones(len(counts), bool) if count is None else counts == count
        return float(self.held[at].mean()) if at.any() else np.nan, int(at.sum())


def covered(
    problem: BoundedProblem, tests: int, one: Callable[[BoundedProblem, int], BoundedTest] = bounded_test
) -> Covered:
    """Simulated tests with the seeds 0, 1, 2 …"""
    found = [one(problem, seed) for seed in range(tests)]
    held = np.array([t.held for t in found])
    return Covered(
        problem.name, problem.words, held, np.array([t.held_if_known for t in found]),
        np.array([t.on_bound for t in found]), float(min(t.lowest for t in found)),
    )  # fmt: skip


def shapes(tests: int) -> Covered:
    """A chain of springs by shapes whose entries have standard deviations of their own."""
    problem = shapes_with_deviations()
    found = []
    for seed in range(tests):
        truth, one = problem.problem(seed)
        result = update(one)
        on_bound = np.isin(problem.names, result.history[-1].at_bound)
        intervals, sd, values = result.interval(LEVEL), result.sd, result.values
        held = np.array([intervals[n][0] <= truth[n] <= intervals[n][1] for n in problem.names])
        known = np.array([abs(values[n] - truth[n]) <= norm.ppf(0.975) * sd[n] for n in problem.names])
        lowest = min(intervals[n][0] for n in problem.names)
        found.append((held, known, on_bound, lowest))
    held, known, on_bound, lowest = (np.array(x) for x in zip(*found))
    return Covered("shapes", problem.words, held, known, on_bound, float(lowest.min()))


def check(found: Sequence[Covered]) -> None:
    """Coverage in the band that is required, or for few tests in the band of chance; that of all problems together."""
    for one in found:
        for count in (None, 0, 1, one.held.shape[1] // 2):
            share, number = one.coverage(count)
            if count is None or number >= LEAST:
                assert _allowed(share, number), (one.name, count, share, number)
        assert one.lowest >= 0.0, (one.name, one.lowest)
    shares, numbers = zip(*(one.coverage() for one in found))
    assert _allowed(float(np.mean(shares)), sum(numbers)), shares


def _allowed(share: float, tests: int) -> bool:
    # intervals of one test are not independent: the band of chance counts tests, not intervals
    low, high = binom.ppf([5e-4, 1 - 5e-4], tests, LEVEL) / tests
    return bool(min(low, LOWER) <= share <= max(high, UPPER))


def text(found: Sequence[Covered], outside: Reals, tests: int) -> str:
    """The page."""
    rows = [row for one in found for row in one.rows()]
    shown = [f"| {place} | {100 * share:.1f} |" for place, share in zip(("on its bound", "outside"), outside)]
    return "\n".join([
        "# Coverage of intervals beside active bounds", "",
        f"{tests} simulated tests of each problem. The true values are drawn from the prior that the intervals assume. "
        "The table shows how many of the 95 % intervals contain the true value, in all tests, and in the tests that "
        "leave none, one or half of the parameters on a bound.", "",
        f"Required: {100 * LOWER:.0f} to {100 * UPPER:.0f} %.", "",
        "| problem | parameters on a bound | tests | coverage % | % if parameters on a bound count as known |",
        "| --- | --- | --- | --- | --- |", *rows, "",
        "The last column is the coverage of the other parameters if those on a bound are fixed there, as least-squares "
        "programs do; these give no interval for a parameter on its bound.", "",
        *[f"**{one.name}**: {one.words} Lowest end of all intervals: {one.lowest:.3g}." + "\n" for one in found],
        "True values that the prior excludes have no target (500 tests each). If the first parameter of the first "
        "problem is always on its lower bound, or 20 % of the width of the bounds below it, the intervals of the six "
        "parameters contain the truth as follows; the interval of a parameter outside its bounds never does.", "",
        "| first parameter | coverage of all parameters % |", "| --- | --- |", *shown, "",
    ])  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer tests, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    tests = FEW if options.quick else 2000
    found = [*(covered(problem, tests) for problem in PROBLEMS), shapes(tests)]
    check(found)
    outside = np.array([
        np.mean([bounded_test(replace(PROBLEMS[0], truth=first_at(depth)), s).held for s in range(min(tests, 500))])
        for depth in (0.0, -0.2)
    ])  # fmt: skip
    page = text(found, outside, tests)
    print(page)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "cases_coverage_bounds.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
