"""Test whether 95 % intervals contain the true value in 95 % of all tests: python run.py [--quick] [--evidence DIR].

Many simulated tests, each with a different sample of noise, of two problems with known parameters: a chain of springs
with stated standard deviations, and a cantilever whose standard deviation is estimated with two degrees of freedom. In
a third problem the model lacks one spring. The full form updates 1000 tests of each of the first two problems and takes
minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from scipy.stats import binom, norm, t

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, LINE, ORANGE
from structures.coverage import CoverageProblem, CoverageRun, run_coverage, spring_chain, stepped_cantilever

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVEL, UNMODELLED = 0.95, 0.15


@dataclass(frozen=True)
class Size:
    """Tests of the right models and of the wrong one, and the band in which the coverage must lie."""

    tests: int
    wrong: int
    lower: float
    upper: float


def by_chance(tests: int) -> tuple[float, float]:
    """The band that an honest interval leaves less than once in a thousand."""
    return binom.ppf(5e-4, tests, LEVEL) / tests, binom.ppf(1 - 5e-4, tests, LEVEL) / tests


QUICK = Size(20, 5, *by_chance(20))
FULL = Size(1000, 200, 0.93, 0.97)


@dataclass(frozen=True)
class Found:
    """A problem and what its updates found; degrees of freedom of the scatter, infinite where it is stated."""

    problem: CoverageProblem
    run: CoverageRun
    degrees: float

    @property
    def words(self) -> str:
        """How its intervals are made."""
        return "stated, normal" if np.isinf(self.degrees) else f"estimated, Student's t with {self.degrees:.0f}"


def study(size: Size) -> tuple[list[Found], CoverageRun]:
    """Both right models and the wrong one, asserted."""
    found = [
        Found(spring_chain(), run_coverage(spring_chain(), range(size.tests)), np.inf),
        Found(stepped_cantilever(), run_coverage(stepped_cantilever(), range(size.tests)), 2.0),
    ]
    wrong = run_coverage(spring_chain(UNMODELLED), range(size.wrong))
    for one in found:
        assert (one.run.coverage >= size.lower).all(), (one.problem.name, one.run.coverage)
        # bounds that cut off a wide distribution make intervals of values far inside them hold more often
        upper = size.upper if np.isinf(one.degrees) else 1.0
        assert (one.run.coverage <= upper).all(), (one.problem.name, one.run.coverage)
    # normal intervals from two degrees of freedom would not do
    assert found[1].run.normal_coverage.mean() < 0.9
    # a right model is suspected once in a hundred tests for each of its two kinds of residual, a wrong one always
    assert found[0].run.suspected.mean() <= binom.ppf(1 - 5e-4, size.tests, 0.02) / size.tests
    assert wrong.suspected.all()
    return found, wrong


def figure(found: Sequence[Found], size: Size) -> str:
    """Coverage by parameter, and how far from the truth the estimates lie."""

    def draw(sheet: Figure) -> None:
        left, *right = sheet.subplots(1, 3, width_ratios=[1.5, 1.0, 1.0])
        _coverage(left, found, size)
        for axes, one in zip(right, found):
            _errors(axes, one)

    return draw_svg(9.4, 3.1, draw)


def _coverage(axes: Axes, found: Sequence[Found], size: Size) -> None:
    names = [name for one in found for name in one.run.names]
    honest = np.concatenate([one.run.coverage for one in found])
    normal = np.concatenate([one.run.normal_coverage for one in found])
    axes.axhspan(100 * size.lower, 100 * size.upper, color=LINE, zorder=0)
    axes.axhline(100 * LEVEL, color=INK, linewidth=0.8, linestyle="--")
    axes.plot(names, 100 * honest, "o", color=BLUE, label="intervals of the update")
    at = [i for i, one in enumerate(o for o in found for _ in o.run.names) if np.isfinite(one.degrees)]
    axes.plot(at, 100 * normal[at], "x", color=ORANGE, label="±1.96 σ instead")
    axes.set_ylabel("intervals that hold the truth, %")
    axes.set_ylim(min(72.0, 100 * normal.min() - 3), 101)
    axes.legend(frameon=False, fontsize=7, loc="lower left")
    axes.set_title("coverage of 95 % intervals")


def _errors(axes: Axes, one: Found) -> None:
    z, grid = np.clip(one.run.errors.ravel(), -7, 7), np.linspace(-6.5, 6.5, 300)
    axes.hist(z, bins=np.linspace(-7, 7, 57), density=True, color=BLUE, alpha=0.35)
    axes.plot(grid, norm.pdf(grid), color=INK, linewidth=1.0, linestyle=":", label="normal")
    if np.isfinite(one.degrees):
        axes.plot(grid, t.pdf(grid, one.degrees), color=ORANGE, linewidth=1.2, label="Student's t")
    axes.set_xlabel("(updated − true)/σ")
    axes.set_yticks([])
    axes.legend(frameon=False, fontsize=7)
    axes.set_title(one.problem.name)


def text(found: Sequence[Found], wrong: CoverageRun, size: Size) -> str:
    """The page."""
    rows = [
        f"| {one.problem.name} | {name} | {true:g} | {one.words} | {100 * held:.1f} | {100 * normal:.1f} |"
        for one in found
        for (name, true), held, normal in zip(one.problem.truth.items(), one.run.coverage, one.run.normal_coverage)
    ]
    return "\n".join([
        "# Coverage of the confidence intervals", "",
        f"{size.tests} simulated tests of each of two problems, each updated with its own sample of Gaussian noise. "
        "The table shows how many of the 95 % confidence intervals contain the true value.", "",
        f"Required: {100 * size.lower:.1f} to {100 * size.upper:.1f} %, and at least {100 * size.lower:.1f} % for the "
        "second problem. Its intervals are wide and end at the bounds; true values far inside the bounds are then "
        "contained more often. With true values drawn between the bounds [95 % are reached](cases_coverage_bounds.md).",
        "",
        "| problem | parameter | true value | standard deviations, interval | coverage % | with ±1.96 σ % |",
        "| --- | --- | --- | --- | --- | --- |", *rows, "",
        "![Coverage by parameter, and the distribution of the errors](cases_coverage.svg)", "",
        "**Spring chain**: six masses, seven springs, four factors from five frequencies (0.4 %) and shapes (0.02 of "
        "unit norm) with stated standard deviations. **Stepped cantilever**: two bending stiffnesses and the tip "
        "mass from five frequencies with unknown standard deviation; it is estimated with two degrees of freedom, "
        "so that the coverage of ±1.96 σ would be much too small.", "",
        f"The residuals were reported as larger than noise in {100 * found[0].run.suspected.mean():.1f} % of the "
        f"tests of the correct spring chain (two kinds of residual, each at 1 %). With a spring of {UNMODELLED:g} "
        "of the others' stiffness that the structure has and the model does not, in "
        f"{100 * wrong.suspected.mean():.0f} % of {size.wrong} tests.", "",
    ])  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer tests, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    found, wrong = study(size)
    page = text(found, wrong, size)
    print(page)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "cases_coverage.md").write_text(page, encoding="utf-8")
        (options.evidence / "cases_coverage.svg").write_text(figure(found, size), encoding="utf-8")


if __name__ == "__main__":
    main()
