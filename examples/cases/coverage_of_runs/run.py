"""Coverage of the intervals of a model that is a table of runs: python run.py [--quick] [--evidence DIR].

A table of 200 runs of six frequencies over three parameters is the model, by polynomials and by surrogates. The
parameters of 2000 simulated specimens (8 in the quick form) are found from their noisy frequencies; 90 % intervals
must contain the true values in 87 to 93 % of all cases. A second table has specimens whose frequencies belong to two
sets of parameters; it is computed in the full form.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # where structures/ lies

from scipy.stats import binom

from femtune.surrogates import ChaosRules, KrigingRules, RadialRules, SurrogateRules
from structures.coverage_of_runs import (
    NAMES,
    NOISE,
    ExactCoverage,
    RunsCoverage,
    ambiguous,
    coverage,
    exact_coverage,
    unique,
)

LEVEL, LOWER, UPPER = 0.90, 0.87, 0.93
RUNS = 200
MODELS: dict[str, SurrogateRules | None] = {
    "polynomials of degree 3": None,
    "Kriging, quadratic trend, Gaussian correlation": KrigingRules("quadratic"),
    "radial basis functions, cubic": RadialRules(),
    "polynomial chaos": ChaosRules(),
}
CHAINS = {"one solution": unique, "two solutions": ambiguous}


def band(specimens: int, quick: bool) -> tuple[float, float]:
    """What is required; of few specimens, what an honest interval of one parameter leaves once in a thousand."""
    if not quick:
        return LOWER, UPPER
    return tuple(binom.ppf([5e-4, 1 - 5e-4], specimens, LEVEL) / specimens)


def page(found: dict[str, RunsCoverage], both: dict[str, RunsCoverage], exact: dict[str, ExactCoverage]) -> str:
    """The evidence."""
    specimens = exact["one solution"].specimens
    lines = [
        "# Intervals from a table of runs",
        "",
        "The model is a table of 200 runs: six frequencies of a chain of masses over three parameters, some of which "
        "do not act linearly on the stiffness, drawn within ±20 %. The specimens have parameters within ±12 %, and "
        f"their frequencies are measured with a noise of {100 * NOISE:.1f} %. Each is updated from the nominal values "
        "with its own sample of noise; the tables show how many of the 90 % intervals contain the true value. "
        "Required: 87 to 93 % of all intervals. Beside the models of the table stands the chain itself, fitted by "
        "SciPy to the same specimens. The intervals contain the scatter of the test only, not the error of the model. "
        f"The standard deviation of a coverage of {specimens} specimens is "
        f"{100 * (LEVEL * (1 - LEVEL) / specimens) ** 0.5:.1f} percentage points for one parameter.",
        "",
        *_table(found, exact["one solution"]),
    ]
    if both:
        chain = exact["two solutions"]
        lines += [
            "",
            "## Frequencies that belong to two sets of parameters",
            "",
            "Other springs between the same masses make the task ambiguous: a stiff b with a soft c, and the reverse, "
            "may have nearly the same frequencies. Of the specimens, "
            f"{100 * chain.local / chain.specimens:.1f} % end in a minimum that is worse than the one at the true "
            f"values, and for {100 * chain.other / chain.specimens:.1f} % another minimum is better than that. The "
            "intervals around one solution cannot contain the other. They are as short with the chain itself, so that "
            "the table is not the cause. Several starts show that there are two solutions.",
            "",
            *_table(both, chain),
        ]
    return "\n".join([*lines, ""])


def _table(found: dict[str, RunsCoverage], exact: ExactCoverage) -> list[str]:
    """A line each model, and the chain itself."""
    rows = [(name, f"{100 * f.error.max():.2g} %", f.hits, f.specimens) for name, f in found.items()]
    rows += [
        ("the chain itself", "–", exact.hits, exact.specimens),
        ("the chain itself, started at the true values", "–", exact.hits_from_truth, exact.specimens),
    ]
    heads = " | ".join(f"{name} %" for name in NAMES)
    return [
        f"| model | error of a run that is left out, worst mode | specimens | {heads} | all % |",
        "| --- " * (4 + len(NAMES)) + "|",
        *(
            f"| {name} | {error} | {count} | {' | '.join(f'{100 * h / count:.1f}' for h in hits)} | "
            f"{100 * hits.sum() / (len(NAMES) * count):.1f} |"
            for name, error, hits, count in rows
        ),
    ]


def main() -> None:
    """Count, check, and write the evidence where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="8 specimens instead of 2000, one chain")
    parser.add_argument("--evidence", type=Path, help="folder for the table of the documentation")
    arguments = parser.parse_args()
    specimens = 8 if arguments.quick else 2000
    found = {name: coverage(RUNS, specimens, rules=rules) for name, rules in MODELS.items()}
    exact = {name: exact_coverage(RUNS, specimens, springs=springs) for name, springs in CHAINS.items()}
    both = {}
    if not arguments.quick:
        both = {name: coverage(RUNS, specimens, rules=MODELS[name], springs=ambiguous) for name in list(MODELS)[:2]}
    text = page(found, both, exact)
    print(text)
    lower, upper = band(specimens, arguments.quick)
    for name, f in found.items():
        assert all(lower <= hits / f.specimens <= upper for hits in f.hits), (name, f.hits)
    for name, f in both.items():
        # as the chain itself, within what the noise of both explains
        assert abs(f.share - exact["two solutions"].hits.sum() / (3 * specimens)) < 0.03, (name, f.share)
    if arguments.evidence:
        (arguments.evidence / "cases_coverage_of_runs.md").write_text(text)


if __name__ == "__main__":
    main()
