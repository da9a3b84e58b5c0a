"""Coverage of the intervals of a model that is a table of runs: python run.py [--quick] [--evidence DIR].

A table of 200 runs of six frequencies over three parameters is the model, by polynomials and by Kriging. The parameters
of 2000 simulated specimens (60 in the quick form) are found from their noisy frequencies; 90 % intervals must contain
the true values in 87 to 93 % of all cases.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

from scipy.stats import binom

from structures.coverage_of_runs import NAMES, NOISE, RunsCoverage, coverage

LEVEL, LOWER, UPPER = 0.90, 0.87, 0.93
MODELS = {"polynomials of degree 3": None, "Kriging, quadratic trend, Gaussian correlation": "gaussian"}


def band(specimens: int, quick: bool) -> tuple[float, float]:
    """What is required; of few specimens, what an honest interval of one parameter leaves once in a thousand."""
    if not quick:
        return LOWER, UPPER
    return tuple(binom.ppf([5e-4, 1 - 5e-4], specimens, LEVEL) / specimens)


def page(found: dict[str, RunsCoverage]) -> str:
    """The evidence."""
    specimens = next(iter(found.values())).specimens
    lines = [
        "# Intervals from a table of runs",
        "",
        "The model is a table of 200 runs: six frequencies of a chain of masses over three parameters, two of which do "
        "not act linearly on the stiffness, drawn within ±20 %. The specimens have parameters within ±12 %, and their "
        f"frequencies are measured with a noise of {100 * NOISE:.1f} %. Each is updated with its own sample of noise; "
        "the table shows how many of the 90 % intervals contain the true value. Required: 87 to 93 % of all "
        "intervals; single parameters may lie outside.",
        "",
        "| model of the table | error of a run that is left out, worst mode | specimens | "
        + " | ".join(f"{name} %" for name in NAMES)
        + " | all % |",
        "| --- " * (4 + len(NAMES)) + "|",
    ]
    for name, f in found.items():
        each = " | ".join(f"{100 * hits / f.specimens:.1f}" for hits in f.hits)
        lines.append(f"| {name} | {100 * f.error.max():.2g} % | {f.specimens} | {each} | {100 * f.share:.1f} |")
    lines += [
        "",
        "The intervals contain the scatter of the test only, not the error of the model. The intervals of Kriging are "
        "shorter than they should be for two of the parameters although its error at left-out runs is smaller; the "
        f"cause was not found. The standard deviation of a coverage of {specimens} specimens is "
        f"{100 * (LEVEL * (1 - LEVEL) / specimens) ** 0.5:.1f} percentage points for one parameter.",
        "",
    ]
    return "\n".join(lines)


def main() -> None:
    """Count, check, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="60 specimens instead of 2000")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    arguments = parser.parse_args()
    specimens = 60 if arguments.quick else 2000
    found = {name: coverage(200, specimens, correlation=kind) for name, kind in MODELS.items()}
    text = page(found)
    print(text)
    lower, upper = band(specimens, arguments.quick)
    for name, f in found.items():
        assert lower <= f.share <= upper, (name, f.share)
    if arguments.evidence:
        (arguments.evidence / "cases_coverage_of_runs.md").write_text(text)


if __name__ == "__main__":
    main()
