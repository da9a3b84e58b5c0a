"""Compute the lowest and highest eigenvalues for stiffnesses in intervals: python run.py [--quick] [--evidence DIR].

Three masses with separated eigenvalues, and three with a repeated one. The corners are proven to be the extrema; a
search without this proof and random points confirm them. In the inverse problem the intervals of the stiffnesses are
determined from those of the eigenvalues.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.canvas import draw_svg
from femtune.document.figures.svg import BLUE, INK, ORANGE, PALE
from femtune.model import ConfiguredModel
from femtune.uncertainty import (
    Bounds,
    EigenvalueOutputs,
    IntervalResult,
    definite_signs,
    interval_bounds,
    interval_update,
)
from structures.springs import factor_model, spring_structure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Reals = NDArray[np.float64]
WITHIN = 1e-3


@dataclass(frozen=True)
class Problem:
    """Springs with masses, the intervals of three factors on them, and the published extrema."""

    name: str
    springs: tuple[tuple[int, int, float], ...]
    masses: tuple[float, ...]
    factors: dict[str, list[int]]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    published: tuple[tuple[float, ...], tuple[float, ...]]

    def model(self) -> ConfiguredModel:
        """The model with its factors."""
        return factor_model(spring_structure(self.springs, self.masses), self.factors)


APART = Problem(
    "separated eigenvalues", ((0, -1, 1.0), (1, -1, 1.0), (2, -1, 1.0), (0, 1, 1.0), (1, 2, 1.0), (0, 2, 3.0)),
    (1.0, 1.0, 1.0), {"k1": [1], "k2": [2], "k5": [5]}, (0.8, 0.8, 0.8), (1.2, 1.2, 1.2),
    ((0.86482, 3.53112, 7.80405), (1.13176, 4.46370, 8.20454)),
)  # fmt: skip
REPEATED = Problem(
    "repeated eigenvalue", ((1, -1, 8.0), (0, 1, 2.0), (1, 2, 2.0), (0, 2, 1.0)), (1.0, 4.0, 1.0),
    {"k2": [1], "k4": [2], "k5": [3]}, (7.5 / 8, 0.9, 0.9), (8.5 / 8, 1.1, 1.1),
    ((0.92454, 3.65046, 3.80000), (1.07462, 4.20000, 4.35038)),
)  # fmt: skip


@dataclass(frozen=True)
class Found:
    """Extrema by proof and by search, eigenvalues at random points, and the problem turned round."""

    problem: Problem
    proven: Bounds
    searched: Bounds
    random: Reals
    back: IntervalResult


def study(problem: Problem, points: int) -> Found:
    """All of one problem."""
    model = problem.model()
    outputs, signs = EigenvalueOutputs(model, 3, np.ones(3)), definite_signs(model)
    box = np.array(problem.lower), np.array(problem.upper)
    proven = interval_bounds(outputs, *box, signs)
    drawn = np.random.default_rng(0).uniform(*box, (points, 3))
    start = np.full(3, 0.95), np.full(3, 1.05)
    back = interval_update(outputs, (proven.lower, proven.upper), start, signs)
    return Found(problem, proven, interval_bounds(outputs, *box), np.array([outputs.values(t) for t in drawn]), back)


def check(found: Found) -> None:
    """Published extrema within 0.1 %, nothing outside them, and the way back."""
    for one in (found.proven, found.searched):
        np.testing.assert_allclose(one.lower, found.problem.published[0], rtol=WITHIN)
        np.testing.assert_allclose(one.upper, found.problem.published[1], rtol=WITHIN)
    assert found.proven.proven
    assert found.proven.solutions == 2
    assert (found.random >= found.proven.lower - 1e-9).all()
    assert (found.random <= found.proven.upper + 1e-9).all()
    np.testing.assert_allclose(found.back.lower, found.problem.lower, rtol=1e-6)
    np.testing.assert_allclose(found.back.upper, found.problem.upper, rtol=1e-6)


def text(found: list[Found], points: int) -> str:
    """The page."""
    lines = [
        "# Intervals of eigenvalues", "",
        "Three stiffness factors are between two limits. The matrix of each spring is positive semidefinite, so "
        "that ordered eigenvalues increase with it: two corners of the box are proven to be the extrema. In the "
        "second problem the centre of the box has a repeated eigenvalue; both modes are followed as one subspace, "
        "with its two eigenvalues sorted.",
    ]  # fmt: skip
    for one in found:
        lines += [
            "",
            f"## {one.problem.name.capitalize()}",
            "",
            "| λ | lowest | reference | highest | reference |",
            "| --- " * 5 + "|",
        ]
        for j, values in enumerate(
            zip(one.proven.lower, one.problem.published[0], one.proven.upper, one.problem.published[1])
        ):
            lines.append(f"| {j + 1} | " + " | ".join(f"{v:.5f}" for v in values) + " |")
        ends = ", ".join(
            f"{n} {a:.4f} to {b:.4f}" for n, a, b in zip(one.problem.factors, one.back.lower, one.back.upper)
        )
        lines += ["", (
            f"{one.proven.solutions} model solutions with the proof; {one.searched.solutions} for the search "
            f"without it, which finds the same corners. None of {points} random points is outside."
        ),
                  "", (
                      f"Inverse problem, starting from a box of 5 %: {ends} ({one.back.solutions} solutions; "
                      f"{one.back.status.value})."
                  )]  # fmt: skip
    return "\n".join([*lines, "", "![Eigenvalues at random points and their extrema](cases_intervals.svg)", ""])


def figure(found: list[Found]) -> str:
    """Eigenvalues at random points, extrema and published values."""

    def draw(sheet: Figure) -> None:
        for axes, one in zip(sheet.subplots(1, 2), found):
            for j, values in enumerate(one.random.T):
                axes.plot(
                    values,
                    np.full(len(values), j + 1) + np.linspace(-0.12, 0.12, len(values)),
                    ".",
                    color=PALE,
                    markersize=2,
                )
                axes.plot([one.proven.lower[j], one.proven.upper[j]], [j + 1] * 2, "|-", color=BLUE, markersize=14)
                axes.plot([p[j] for p in one.problem.published], [j + 1] * 2, "x", color=ORANGE, markersize=5)
            axes.set_yticks([1, 2, 3], ["λ1", "λ2", "λ3"])
            axes.set_xlabel("eigenvalue, rad²/s²")
            axes.set_title(one.problem.name, color=INK)
            axes.grid(axis="x")

    return draw_svg(8.4, 2.4, draw)


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer random points, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    points = 60 if options.quick else 500
    found = [study(problem, points) for problem in (APART, REPEATED)]
    for one in found:
        check(one)
    page = text(found, points)
    print(page)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "cases_intervals.md").write_text(page, encoding="utf-8")
        (options.evidence / "cases_intervals.svg").write_text(figure(found), encoding="utf-8")


if __name__ == "__main__":
    main()
