"""What a row says: was the fit harmful, did the judge find it, and whom did it blame."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from scipy.stats import norm

Row = dict[str, Any]
HARM = 3.0
"""Stated standard deviations by which a parameter misses the truth in a harmful fit."""
TODAY = 0.01
"""Level of the goodness-of-fit test that stands beside the judge."""
BETTER = 1.0
"""Decrease of χ² from which another minimum is a better one."""
TESTS: dict[str, tuple[str, ...]] = {
    "parts": ("judge.parts",),
    "neighbours": ("judge.neighbour",),
    "missing parameter": ("judge.missing",),
}
"""Beginnings of the codes of the reasons that say that noise does not explain the fit, by test."""
_HALF_WIDTH = float(norm.ppf(0.975))


def solved(run: Row | None) -> bool:
    """True where a run has results."""
    return run is not None and "error" not in run


def misses(run: Row) -> Iterator[float]:
    """Error of each parameter in its stated standard deviation."""
    for p in run["parameters"]:
        if p["sd"]:
            yield abs(p["value"] - p["true"]) / p["sd"]


def harmful(run: Row) -> bool:
    """True if a parameter misses the truth by more than `HARM` of its standard deviations."""
    return any(miss > HARM for miss in misses(run))


def covered(run: Row) -> list[bool]:
    """Whether each interval contains the truth; parameters without an interval have none."""
    return [low <= p["true"] <= high for p in run["parameters"] if p["interval"] for low, high in [p["interval"]]]


def half_widths(run: Row) -> list[float]:
    """Of the 95 % intervals, relative to the truth."""
    return [_HALF_WIDTH * p["sd"] / p["true"] for p in run["parameters"] if p["sd"]]


def found_today(run: Row) -> bool:
    """True if the test of all residuals together refuses the fit."""
    goodness = run["goodness"]
    return goodness is not None and goodness["p"] is not None and goodness["p"] < TODAY


def judged(run: Row) -> bool:
    """True if the run has a verdict."""
    return run.get("judgement") is not None


def reasons(run: Row) -> list[Row]:
    """Of the verdict; none without one."""
    return run["judgement"]["reasons"] if judged(run) else []


def found_by(run: Row, test: str) -> bool:
    """True if a test of `TESTS` gives a reason."""
    return any(reason["code"].startswith(TESTS[test]) for reason in reasons(run))


def found(run: Row) -> bool:
    """True if any of these tests gives a reason."""
    return any(found_by(run, test) for test in TESTS)


def refused(run: Row) -> bool:
    """True for the verdict "not accepted"."""
    return judged(run) and run["judgement"]["verdict"] == "not accepted"


def culprits(run: Row) -> list[Row]:
    """What is suspected to be missing, the first suspect first; each with its look-alikes."""
    return ((run.get("judgement") or {}).get("missing") or {}).get("ranking", [])


def rank_of(run: Row, field: str) -> int | None:
    """Place of a field among the suspects, from 1; None if it is not among them."""
    for place, suspect in enumerate(culprits(run), start=1):
        if field in (suspect["field"], *suspect.get("look_alikes", ())):
            return place
    return None


def sign_right(run: Row, field: str, factor: float) -> bool | None:
    """Whether the foretold change of a field has the sign of the true one; None if it is no suspect of its own."""
    for suspect in culprits(run):
        if suspect["field"] == field:
            return (suspect["change"] > 0.0) == (factor > 1.0)
    return None


def beaten(row: Row, run: Row) -> bool | None:
    """Whether starts found a lower χ² of as many residuals; None if this was not tried or cannot be compared."""
    starts = row["starts"]
    if starts is None or "error" in starts or starts["compared"] != run["compared"]:
        return None
    return starts["chi_square"] < run["chi_square"] - BETTER
