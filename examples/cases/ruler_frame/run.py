"""Determine the variability of a real frame from 50 repeated tests: python run.py [--quick] [--evidence DIR].

A frame of four blocks on steel rulers was assembled and tested fifty times. Mean and covariance of its four storey
stiffnesses are determined from the 50 × 4 frequencies, and the sample of the updated model is compared with the
measured one. The measurements are read from the folder in $FEMTUNE_SHARED_DATA, or from ../shared/data beside the
checkout.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

import numpy as np
from numpy.typing import NDArray

from femtune.document.figures.parameters import Cloud, clouds_svg
from femtune.uncertainty import (
    ForwardCheck,
    FrequenciesByOrder,
    OutputStatistics,
    StochasticResult,
    forward_check,
    statistics_of_repeats,
    stochastic_update,
)
from structures.springs import factor_model, spring_structure

Reals = NDArray[np.float64]

BLOCK_KG, LENGTH_M, WIDTH_M, THICK_M, E_PA = 0.1122, 0.0475, 0.0255, 0.00045, 210e9
NOMINAL_HZ = (15.747, 45.342, 69.467, 85.214)
NAMES, FREQUENCIES = ("k1", "k2", "k3", "k4"), ("f1, Hz", "f2, Hz", "f3, Hz", "f4, Hz")
OUTLIER = 31
START_SD = 0.1


def shared_file() -> Path:
    """The fifty repeats."""
    beside = Path(__file__).resolve().parents[4] / "shared" / "data"
    return Path(os.environ.get("FEMTUNE_SHARED_DATA", beside)) / "ruler_frame_repeats" / "frequencies_50_repeats.csv"


def outputs() -> FrequenciesByOrder:
    """Four blocks, two rulers a storey that are clamped at both ends: k = 2·12 EI/L³."""
    storey = 24.0 * E_PA * WIDTH_M * THICK_M**3 / 12.0 / LENGTH_M**3
    springs = [(i, i - 1, storey) for i in range(4)]
    structure = spring_structure(springs, [BLOCK_KG] * 4)
    return FrequenciesByOrder(factor_model(structure, {n: [i + 1] for i, n in enumerate(NAMES)}), 4)


def study(table: Reals, samples: int) -> dict[str, tuple[OutputStatistics, StochasticResult, ForwardCheck]]:
    """All repeats, and those without the one that lies apart: plain and second order are told from each other."""
    model, found = outputs(), {}
    np.testing.assert_allclose(model.values(np.ones(4)), NOMINAL_HZ, atol=6e-4)
    for label, rows in (
        ("all 50 repeats", table),
        (f"without repeat {OUTLIER}", np.delete(table, OUTLIER - 1, axis=0)),
    ):
        measured = statistics_of_repeats(rows, FREQUENCIES)
        result = stochastic_update(model, measured, NAMES, np.ones(4), np.full(4, START_SD))
        found[label] = measured, result, forward_check(model, result, samples)
    return found


def check(found: dict[str, tuple[OutputStatistics, StochasticResult, ForwardCheck]]) -> None:
    """The cloud of the model is that which was measured, and the odd repeat is named."""
    for _, result, forward in found.values():
        assert result.status.ok
        assert np.abs(forward.mean_error).max() < 0.01
        assert np.abs(forward.sd_error).max() < 0.02
        assert forward.covariance_error < 0.02
        assert forward.agrees
    (notices, later) = (s.notices for s, *_ in found.values())
    assert [f": {OUTLIER} (" in n.what for n in notices if n.code == "quantify.outlier"] == [True]
    assert not [n for n in later if n.code == "quantify.outlier"]
    # one repeat in fifty makes the storeys look independent, which they are not
    first, second = (r.correlation[0, 2] for _, r, _ in found.values())
    assert first < 0.5
    assert second > 0.8


def text(found: dict[str, tuple[OutputStatistics, StochasticResult, ForwardCheck]], samples: int) -> str:
    """The page."""
    lines = [
        "# Ruler frame: 50 repeated tests (real test)", "",
        "Four blocks on steel rulers, assembled and tested 50 times. Nominal stiffness of a storey: two rulers of "
        f"{1000 * LENGTH_M:g} mm, clamped at both ends (nominal frequencies "
        f"{', '.join(f'{f:.3f}' for f in NOMINAL_HZ)} Hz). The parameters are factors on the four storeys.",
    ]  # fmt: skip
    for label, (measured, result, forward) in found.items():
        lines += [
            "",
            f"## {label.capitalize()}",
            "",
            "| storey | factor | σ, % | correlation with k1 | k2 | k3 | k4 |",
            "| --- " * 7 + "|",
        ]
        for i, name in enumerate(NAMES):
            row = " | ".join(f"{c:.2f}" for c in result.correlation[i])
            lines.append(f"| {name} | {result.mean[i]:.4f} | {100 * result.sd[i] / result.mean[i]:.2f} | {row} |")
        lines += ["", "| mode | measured mean Hz | model | measured σ Hz | model |", "| --- " * 5 + "|"]
        numbers = zip(measured.mean, forward.mean, measured.sd, forward.sd)
        lines += [f"| {i} | {a:.3f} | {b:.3f} | {c:.4f} | {d:.4f} |" for i, (a, b, c, d) in enumerate(numbers, start=1)]
        lines += ["", f"{result.solutions} model solutions; forward check with {samples}: {forward.sentences[0]}"]
        lines += [f"Notice: {n.what}." for n in measured.notices]
    return "\n".join([
        *lines, "", (
            "With four factors from four frequencies the model reproduces the covariance, whether the storeys vary "
            "or something else does (see [an inconsistent set](cases_inconsistent_set.md)). The positive "
            "correlation of the storeys indicates a common cause, such as the clamping or the temperature."
        ), "",
        "![Measured frequencies and the sample of the updated model, 95 % ellipses](cases_ruler_frame.svg)", "",
    ])  # fmt: skip


def figure(forward: ForwardCheck) -> str:
    """The measured cloud and the model's."""
    measured = forward.measured
    return clouds_svg(FREQUENCIES, [
        Cloud("50 tests", measured.repeats, measured.mean, measured.covariance),
        Cloud("updated model", forward.z, forward.mean, forward.covariance),
    ])  # fmt: skip


def main() -> None:
    """Run the example."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer samples, for continuous integration")
    parser.add_argument("--evidence", type=Path, help="folder for the page of the documentation")
    options = parser.parse_args()
    source, samples = shared_file(), 150 if options.quick else 1000
    if not source.is_file():
        print(f"skipped: the measured frequencies are not here ({source})")
        return
    found = study(np.loadtxt(source, delimiter=",", skiprows=1)[:, 1:], samples)
    check(found)
    page = text(found, samples)
    print(page)
    if options.evidence:
        options.evidence.mkdir(parents=True, exist_ok=True)
        (options.evidence / "cases_ruler_frame.md").write_text(page, encoding="utf-8")
        first = next(iter(found.values()))
        (options.evidence / "cases_ruler_frame.svg").write_text(figure(first[2]), encoding="utf-8")


if __name__ == "__main__":
    main()
