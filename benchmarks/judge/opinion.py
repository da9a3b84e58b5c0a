"""What a row says: was the fit harmful, did the judge find it, and whom did it blame."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from scipy.stats import chi2, ncx2, norm

Row = dict[str, Any]
HARM = 3.0
"""Stated standard deviations by which a parameter misses the truth in a harmful fit."""
TODAY = 0.01
"""Level of the goodness-of-fit test that stands beside the judge."""
VISIBLE = 15.0
"""Noncentrality from which a test of 5 % that knows the culprit finds the error in more than 97 % of tests."""
BETTER = 1.0
"""Decrease of χ² from which another minimum is a better one."""
TESTS: dict[str, tuple[str, ...]] = {
    "parts": ("judge.misfit",),
    "neighbours": ("judge.neighbour",),
    "missing parameter": ("judge.missing",),
}
"""Beginnings of the codes of the reasons that say that noise does not explain the fit, by test."""
NEAR = 1.5
"""Factor within which a standard deviation that is named is the right one; frequencies alone have few values."""
_OF_DEVIATIONS = ("judge.misfit", "judge.overstated", "judge.larger-than-assumed")
_HALF_WIDTH = float(norm.ppf(0.975))


def solved(run: Row | None) -> bool:
    """True where a run has results."""
    return run is not None and "error" not in run


def misses(run: Row) -> Iterator[float]:
    """Error of each parameter in the standard deviation that the stated deviations of the data give it.

    That of its interval is wider where residuals are large: by it a misfit would excuse the error that it comes from.
    """
    for p in run["parameters"]:
        if p["sd"]:
            yield abs(p["value"] - p["true"]) / p["stated_sd"]


def harmful(run: Row) -> bool:
    """True if a parameter misses the truth by more than `HARM` standard deviations."""
    return any(miss > HARM for miss in misses(run))


def most_power(signal: float, level: float = 0.05) -> float:
    """Power of the test that knows the culprit: χ² of one degree with a noncentrality, at a level.

    No test of this level that has to look for the culprit finds more.
    """
    return float(ncx2.sf(chi2.isf(level, 1), 1, signal))


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


def suspects(run: Row) -> list[Row]:
    """The fields that may be missing among the parameters, the first suspect first."""
    missing = run["judgement"].get("missing") if judged(run) else None
    return missing["fields"] if missing else []


def rank_of(run: Row, field: str) -> int | None:
    """Place of a field among the suspects, from 1; None if it is not among them."""
    for place, suspect in enumerate(suspects(run), start=1):
        if any(name.startswith(field) for name in (suspect["field"], *suspect["alike"])):
            return place
    return None


def rank_of_mass(run: Row, node: int) -> int | None:
    """Place of a mass at a grid point, or at a neighbourhood with it, among the suspects, from 1.

    A mass that cannot be told from a suspect stands for it, as fields do; that of more than a few points is not named.
    """
    for place, suspect in enumerate(suspects(run), start=1):
        alike = (_POINTS.search(name) for name in suspect["alike"])
        named = {int(n) for found in alike if found for n in found[1].split(",")}
        if node in named or node in suspect.get("points", ()):
            return place
    return None


_POINTS = re.compile(r"^mass, .*grid points? ([0-9]+(?:, [0-9]+)*)$")
"""Grid points in the name of a mass."""


def rank_of_support(run: Row) -> int | None:
    """Place of a support among the suspects, from 1."""
    places = (place for place, suspect in enumerate(suspects(run), start=1) if suspect["field"] == "support")
    return next(places, None)


def sign_right(run: Row, field: str, factor: float) -> bool | None:
    """Whether the foretold change of a field has the sign of the true one; None if it is no suspect of its own."""
    for suspect in suspects(run):
        if suspect["field"] == field:
            return suspect["increase"] == (factor > 1.0)
    return None


def fits(run: Row, kind: str) -> float | None:
    """The standard deviation that fits the residuals of a kind, by the judge; None if it gives none."""
    parts = run["judgement"].get("parts") if judged(run) else None
    for size in parts["kinds"] if parts else ():
        if size["kind"] == kind and size["stated"] and size["factor"]:
            return float(size["stated"] * size["factor"])
    return None


def names_deviations(run: Row, true: dict[str, float]) -> bool:
    """Whether a reason is given, and the judge's standard deviations of all kinds are those of the noise, nearly.

    Parameters
    ----------
    true : standard deviation of the noise by kind of residual
    """
    given = {kind: fits(run, kind) for kind in true}
    near = [value is not None and 1.0 / NEAR < value / true[kind] < NEAR for kind, value in given.items()]
    return all(near) and any(reason["code"].startswith(_OF_DEVIATIONS) for reason in reasons(run))


def beaten(row: Row) -> bool | None:
    """Whether starts found a lower χ² of as many residuals; None if that cannot be compared."""
    nominal, starts = row["nominal"], row["starts"]
    if "error" in nominal or "error" in starts or starts["compared"] != nominal["compared"]:
        return None
    return bool(starts["chi_square"] < nominal["chi_square"] - BETTER)
