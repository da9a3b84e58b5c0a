"""Random starts on the 2302-DOF frame beside SciPy's bounded trust region: python run.py [--starts N] [--evidence DIR].

Both minimise the same residuals with the same analytic Jacobian from the same points, in one process with one thread:
`scipy.optimize.least_squares(method="trf", bounds=…)` on the full model, and `multi_start_reduced`, whose training and
certification are in its time. What counts is CPU time for each start that recovers the truth to 1e-6.
"""

from __future__ import annotations

import argparse
import runpy
import time
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from femtune.residuals import Evaluation, UpdateProblem

Reals = NDArray[np.float64]

CASE = Path(__file__).resolve().parents[2] / "examples" / "cases" / "concrete_frame" / "run.py"
FORM = "difference"


def peer(problem: UpdateProblem, points: Reals, truth: Reals, reached: float) -> tuple[int, float, int]:
    """Starts that SciPy's trust region brings to the truth, CPU seconds and evaluations."""
    begun, hits, evaluations = time.process_time(), 0, 0
    lower, upper = problem.parameters.bounds

    @lru_cache(maxsize=2)
    def evaluated(key: bytes) -> Evaluation:
        return problem.start(np.frombuffer(key))

    for x in points:
        found = least_squares(
            lambda y: evaluated(y.tobytes()).residuals,
            x,
            jac=lambda y: evaluated(y.tobytes()).jacobian,
            bounds=(lower, upper),
            method="trf",
            xtol=1e-12,
            ftol=1e-14,
            gtol=1e-12,
            max_nfev=100,
        )
        hits += bool(np.abs(found.x - truth).max() < reached)
        evaluations += found.nfev
    return hits, time.process_time() - begun, evaluations


def ours(case: Any, facts: dict[str, Any], points: Reals) -> tuple[int, float]:
    """Starts that reach the truth, and CPU seconds."""
    found = facts["search"](case, FORM, points)
    return found.reached, found.cpu_s


def table(count: int, theirs: tuple[int, float, int], mine: tuple[int, float]) -> str:
    """Both beside each other, and their ratio."""
    hits, seconds, evaluations = theirs
    each = [s / max(h, 1) for h, s in ((hits, seconds), mine)]
    return "\n".join(
        [
            "# Random starts beside SciPy", "",
            f"{count} starts in the box of ±1 of the 2302-DOF frame, residuals of shape differences, one thread.", "",
            "| | recovered | CPU s | CPU s a recovered start |", "| --- | --- | --- | --- |",
            f"| scipy least_squares, trf with bounds ({evaluations} evaluations) | {hits} of {count} | {seconds:.0f} | "
            f"{each[0]:.1f} |",
            f"| femtune, equation error first, reduced models | {mine[0]} of {count} | {mine[1]:.0f} | {each[1]:.1f} |",
            f"| ratio | | {seconds / mine[1]:.1f} | {each[0] / each[1]:.1f} |", "",
        ]
    )  # fmt: skip


def main() -> None:
    """Run both from the same points."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--evidence", type=Path, help="folder for the table")
    options = parser.parse_args()
    facts = runpy.run_path(str(CASE))
    source = facts["shared_file"]()
    if not source.is_file():
        print(f"skipped: the matrices are not here ({source})")
        return
    case, points = facts["case_of"](source), facts["random_starts"](options.starts)
    mine = ours(case, facts, points)
    problem = facts["problem_of"](case, FORM)
    theirs = peer(problem, points, np.array(facts["TRUTH"]), facts["REACHED"])
    text = table(len(points), theirs, mine)
    print(text)
    if options.evidence:
        (options.evidence / "benchmark_starts.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
