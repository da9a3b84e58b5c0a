"""Test the rejection rate of the chi-square test for a correct model: python run.py [--quick] [--evidence DIR].

For every kind of residual, in every form and scaling, noise with the stated standard deviation is added to the data,
the residual is evaluated at the true parameters, the linearised fit is made, and the sum of squares is compared with
chi-square with the degrees of freedom that the residual states. The level of the test is 5 %. The full form has 20,000
draws for each and takes about twenty minutes of processor time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

from scipy.stats import binom

from structures.chi_square import LEVEL, Rejections, rejections, trials

BAND = 0.007


@dataclass(frozen=True)
class Size:
    """Draws of each form, and the band in which the rate must lie."""

    draws: int
    lower: float
    upper: float


def by_chance(draws: int) -> tuple[float, float]:
    """The band that a right test leaves in two of ten thousand trials; there are about fifty."""
    return binom.ppf(1e-4, draws, LEVEL) / draws, binom.ppf(1 - 1e-4, draws, LEVEL) / draws


QUICK = Size(80, *by_chance(80))
FULL = Size(20_000, LEVEL - BAND, LEVEL + BAND)


def study(size: Size) -> list[Rejections]:
    """Every form, asserted where it is tested."""
    found = [rejections(trial, size.draws, seed) for seed, trial in enumerate(trials())]
    wrong = [(f.trial.kind, f.trial.form, f.rate) for f in found if f.tested and not size.lower <= f.rate <= size.upper]
    assert not wrong, wrong
    # the kinds that are not tested could not be
    assert all(not size.lower <= f.rate <= size.upper for f in found if not f.tested)
    return found


def text(found: Sequence[Rejections], size: Size) -> str:
    """The page."""
    tested = [
        f"| {f.trial.kind} | {f.trial.form} | {f.values} | {f.freedom} | {100 * f.rate:.2f} "
        f"| {100 * f.plain_rate:.1f} |"
        for f in found
        if f.tested
    ]
    others = [
        f"| {f.trial.kind} | {f.trial.form} | {f.values} | {100 * f.rate:.1f} | {f.why_not} |"
        for f in found
        if not f.tested
    ]
    return "\n".join([
        "# Degrees of freedom of the chi-square test", "",
        "After an update the residuals that no parameter removes are compared with chi-square. The test is right if it "
        f"rejects a right model at the stated level. Noise of the stated standard deviation was drawn on the data "
        f"{size.draws:,} times for each kind of residual, form and scaling, at a level of {100 * LEVEL:g} %. The rate "
        f"must lie between {100 * size.lower:.2f} and {100 * size.upper:.2f} %.", "",
        "The last column is the rate if all values were counted as independent, with degrees of freedom equal to "
        "the number of values less the number of fitted parameters.", "",
        "| residual | form | values | degrees of freedom | rejected % | all counted % |",
        "| --- | --- | --- | --- | --- | --- |", *tested, "",
        "The models are chains of five springs and masses with three parameters, a ring with two pairs of repeated "
        "modes, both also with dashpots, and four masses in space with two parameters.", "",
        "- A scale that follows from the shape itself (unit norm, modal scale factor) takes one degree of freedom for "
        "each shape. Scaling by modal mass takes none. Scaling by the largest entry takes that entry, which is no "
        "residual, and makes the others correlated.",
        "- Shapes of t test modes that are aligned with c model modes lose the ct − t(t + 1)/2 rotations.",
        "- Equation errors of shapes that were measured in part have as many degrees of freedom as measured entries.",
        "",
        "Two kinds are not tested, because their values have no normal distribution. The rate is what the test would "
        "give.", "",
        "| residual | form | values | would be rejected % | reason |",
        "| --- | --- | --- | --- | --- |", *others, "",
    ])  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer draws, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    size = QUICK if options.quick else FULL
    page = text(study(size), size)
    print(page)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "cases_chi_square.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
