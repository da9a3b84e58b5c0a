"""The page of the documentation: criteria, tables by stated standard deviation and by structure."""

from __future__ import annotations

import datetime
import itertools
import os
import platform
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import scipy
from decks import STRUCTURES, SUBFRAME
from measure import STARTS
from opinion import (
    BETTER,
    HARM,
    NEAR,
    TESTS,
    VISIBLE,
    beaten,
    covered,
    found,
    found_by,
    found_today,
    half_widths,
    harmful,
    judged,
    most_power,
    names_deviations,
    rank_of,
    rank_of_mass,
    rank_of_support,
    reasons,
    refused,
    sign_right,
    solved,
)
from rates import CONFIDENCE, Criterion, Rate, rate
from trials import NOISE, STATED, Deviations

import femtune

Row = dict[str, Any]
Test = Callable[[Row], bool]
NAME = "benchmark_judge"
FRF = SUBFRAME.name
_CLAMP = "clamp"
"""Key of elastic clamps."""
_MASS = "mass at "
"""Beginning of the keys of forgotten masses, before the grid point."""
WORDS = {
    "true": "true", "default": "default", "small": "3 times too small", "large": "3 times too large",
}  # fmt: skip


def runs(rows: Sequence[Row], stated: str, *kinds: str) -> list[tuple[Row, Row]]:
    """(row, run) of the trials of some kinds with results."""
    return [
        (row, row["runs"][stated])
        for row in rows
        if row["kind"] in kinds and solved(row["runs"].get(stated))
    ]  # fmt: skip


def judged_runs(rows: Sequence[Row], stated: str, *kinds: str) -> list[tuple[Row, Row]]:
    """Those with a verdict."""
    return [pair for pair in runs(rows, stated, *kinds) if judged(pair[1])]


def level(rows: Sequence[Row], stated: str, test: Test) -> Rate:
    """Share of right models that a test refuses."""
    return rate(test(run) for _, run in judged_runs(rows, stated, "right"))


def power(rows: Sequence[Row], stated: str, kind: str, test: Test) -> Rate:
    """Share of the harmful wrong models of a kind that a test finds."""
    return rate(test(run) for _, run in judged_runs(rows, stated, kind) if harmful(run))


def visible(rows: Sequence[Row]) -> list[Row]:
    """Wrong models whose error a test finds that knows the culprit."""
    return [row for row in rows if (row["signal"] or 0.0) >= VISIBLE]


def coverage(pairs: Sequence[tuple[Row, Row]]) -> Rate:
    """Share of the 95 % intervals with the truth in them."""
    return rate(hit for _, run in pairs for hit in covered(run))


def ranks(rows: Sequence[Row], stated: str, most: int) -> Rate:
    """How often the culprit is among the first suspects, over the harmful fits in which it is a candidate."""
    pairs = [p for p in judged_runs(rows, stated, "candidate") if harmful(p[1])]
    places = [rank_of(run, row["fault"][0]) for row, run in pairs]
    return rate(place is not None and place <= most for place in places)


def mass_ranks(rows: Sequence[Row], stated: str, most: int) -> Rate:
    """How often a forgotten mass is among the first suspects at its place, over the harmful fits."""
    pairs = [p for p in judged_runs(rows, stated, "hidden") if p[0]["fault"][0].startswith(_MASS) and harmful(p[1])]
    places = [rank_of_mass(run, int(row["fault"][0].removeprefix(_MASS))) for row, run in pairs]
    return rate(place is not None and place <= most for place in places)


def support_ranks(rows: Sequence[Row], stated: str, most: int) -> Rate:
    """How often a support is among the first suspects, over the harmful fits of structures whose clamp is elastic."""
    pairs = [p for p in judged_runs(rows, stated, "hidden") if p[0]["fault"][0] == _CLAMP and harmful(p[1])]
    places = [rank_of_support(run) for _, run in pairs]
    return rate(place is not None and place <= most for place in places)


def signs(rows: Sequence[Row], stated: str) -> Rate:
    """How often the sign of the culprit's change is right, where it is a suspect of its own."""
    pairs = [p for p in judged_runs(rows, stated, "candidate") if harmful(p[1])]
    answers = [sign_right(run, *row["fault"]) for row, run in pairs]
    return rate(answer for answer in answers if answer is not None)


def named_deviations(rows: Sequence[Row], stated: str) -> Rate:
    """How often the judge of a right model names the standard deviations of the noise."""
    modal = {"frequency": NOISE.frequency, "shape": NOISE.shape}
    pairs = judged_runs(rows, stated, "right")
    return rate(names_deviations(run, {"frf": NOISE.frf} if row["structure"] == FRF else modal) for row, run in pairs)


def better_minima(started: Sequence[Row]) -> Rate:
    """How often starts found a better minimum."""
    return rate(answer for answer in map(beaten, started) if answer is not None)


def of_test(name: str) -> Test:
    """One of the judge's tests."""
    return lambda run: found_by(run, name)


COLUMNS: dict[str, Test] = {
    "goodness of fit, p < 0.01": found_today,
    **{name: of_test(name) for name in TESTS},
    "any of the three": found,
    "not accepted": refused,
}


def criteria(rows: Sequence[Row], started: Sequence[Row]) -> list[Criterion]:
    """All rates that have a limit."""

    def quiet(stated: str) -> list[tuple[Row, Row]]:
        return [p for p in judged_runs(rows, stated, "candidate", "hidden") if not refused(p[1])]

    both = ("true", "default")
    out = [
        Criterion("true σ: right models in which any of the three tests finds something", level(rows, "true", found),
                  most=0.05),
        Criterion("true σ: 95 % intervals of right models with the truth in them",
                  coverage(runs(rows, "true", "right")), least=0.93, most=0.97),
        Criterion("default σ: right models in which any of the three tests finds something",
                  level(rows, "default", found), most=0.05),
        Criterion("default σ: 95 % intervals of right models with the truth in them",
                  coverage(runs(rows, "default", "right")), least=0.93),
    ]  # fmt: skip
    for stated in ("small", "large"):
        for test in ("neighbours", "missing parameter"):
            text = f"σ {WORDS[stated]}: right models in which the test finds something, {test}"
            out.append(Criterion(text, level(rows, stated, of_test(test)), most=0.05))
    for stated in both:
        out += [
            Criterion(f"{stated} σ: harmful models found, the culprit is a candidate",
                      power(rows, stated, "candidate", found), least=0.97),
            Criterion(f"{stated} σ: harmful models found, the culprit is no candidate",
                      power(rows, stated, "hidden", found), least=0.94),
            Criterion(f"{stated} σ: the same, errors that show: the culprit is a candidate",
                      power(visible(rows), stated, "candidate", found), least=0.97),
            Criterion(f"{stated} σ: the same, errors that show: the culprit is no candidate",
                      power(visible(rows), stated, "hidden", found), least=0.94),
            Criterion(f"{stated} σ: culprit first", ranks(rows, stated, 1), least=0.78),
            Criterion(f"{stated} σ: culprit among the first three", ranks(rows, stated, 3), least=0.93),
            Criterion(f"{stated} σ: 95 % intervals of wrong models that are not refused, with the truth in them",
                      coverage(quiet(stated)), least=0.85),
        ]  # fmt: skip
    out.append(
        Criterion(f"runs in which {STARTS} starts find a χ² lower by more than {BETTER:g}", better_minima(started),
                  most=0.02)
    )  # fmt: skip
    return out


# ----------------------------------------------------------------------------------------------------
# The page.


def page(rows: Sequence[Row], started: Sequence[Row], planned: int) -> str:
    """The whole text; `started` are the rows of the updates from many starts."""
    return "\n".join([
        *_head(rows, planned), *_criteria(rows, started), *_level(rows), *_power(rows), *_signals(rows), *_named(rows),
        *_culprits(rows), *_masses(rows), *_clamps(rows), *_coverage(rows),
        *_by_structure(rows, started), *_reasons(rows), *_failures(rows),
    ])  # fmt: skip


def _deviations(d: Deviations) -> str:
    return f"{100 * d.frequency:.2g} %, {100 * d.shape:.2g} %, {100 * d.frf:.2g} %"


def _head(rows: Sequence[Row], planned: int) -> Iterator[str]:
    yield from ("# How often the judge of a fit is right", "")
    yield (
        "Right and wrong models of six small structures are updated with noisy tests of structures whose values are "
        "known. Made by `benchmarks/judge/run.py`."
    )
    yield ""
    if len(rows) < planned:
        yield from (f"**Incomplete: {len(rows)} of {planned} models are measured.**", "")
    kinds = Counter(row["kind"] for row in rows)
    each = Counter(row["structure"] for row in rows)
    yield f"- Measured on {datetime.datetime.now(tz=datetime.UTC).date()}: {_machine()}; femtune {_revisions(rows)}."
    yield (
        f"- {kinds['right']} right models; {kinds['candidate']} wrong models with another value of a field that is not "
        f"updated; {kinds['hidden']} with an error that is no field of the deck (a forgotten mass or stiffener, an "
        "elastic clamp, a missing weld, a patch of another thickness). "
        + ", ".join(f"{s.name} {each[s.name]}" for s in STRUCTURES)
        + "."
    )
    yield (
        f"- Noise of frequencies, shapes (of the largest entry of each mode) and FRFs: {_deviations(NOISE)}. Stated "
        f"standard deviations: "
        + "; ".join(f"{WORDS[name]} {_deviations(d)}" for name, d in STATED.items())
        + ". The default ones are those that `femtune init` writes, marked as guesses."
    )
    yield (
        f"- A fit is harmful if a parameter misses the truth by more than {HARM:g} standard deviations, as the stated "
        "deviations of the data give them, before the residuals widen them. Errors "
        "whose effect the parameters imitate are not among those of fields of the deck: they harm, and leave no "
        "residuals that a test could find. A rate meets its limit if the limit lies inside its "
        f"{100 * CONFIDENCE:g} % binomial interval or on the right side of it."
    )
    seconds = [run["seconds"] for row in rows for run in row["runs"].values()]
    if seconds:
        yield f"- A run takes {median(seconds):.1f} s of one thread (median; at most {max(seconds):.1f} s)."
    without = sum(not judged(run) for row in rows for run in row["runs"].values() if solved(run))
    if without:
        yield f"- {without} runs have no verdict; levels and powers leave them out."
    yield ""


def _criteria(rows: Sequence[Row], started: Sequence[Row]) -> Iterator[str]:
    found_criteria = criteria(rows, started)
    yield from ("## Criteria", "")
    not_met = sum(not c.met for c in found_criteria)
    unknown = sum(not c.decided for c in found_criteria)
    yield f"{len(found_criteria) - not_met - unknown} of {len(found_criteria)} are met, {not_met} are not, " + (
        f"{unknown} are not measured with enough models."
    )
    yield from ("", f"| criterion | measured | {100 * CONFIDENCE:g} % interval | limit | |",
                "| --- | --- | --- | --- | --- |")  # fmt: skip
    yield from (c.row() for c in found_criteria)
    yield ""


def _table(heads: Sequence[str], body: Sequence[Sequence[object]]) -> Iterator[str]:
    yield "| " + " | ".join(heads) + " |"
    yield "| --- " * len(heads) + "|"
    yield from ("| " + " | ".join(map(str, line)) + " |" for line in body)
    yield ""


def _level(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## False alarms", "", "Share of the right models that a test refuses.", "")
    body = [[WORDS[s], *(level(rows, s, test) for test in COLUMNS.values())] for s in STATED]
    yield from _table(["stated σ", *COLUMNS], body)


def _power(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## Harmful models that are found", "")
    body = []
    for s in STATED:
        for kind, words in (("candidate", "a field of the deck"), ("hidden", "no field of the deck")):
            body.append([WORDS[s], words, *(power(rows, s, kind, test) for test in COLUMNS.values())])
    yield from _table(["stated σ", "culprit", *COLUMNS], body)


SIGNALS = (0.0, 8.0, VISIBLE, 30.0, float("inf"))
"""Bounds of the rows of the table of signals."""


def _signals(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## By how much an error shows", "",
                "Harmful models by the noncentrality that the error gives χ² with the true deviations, after the "
                "parameters have taken what they can. The column \"culprit known\" is the power that a test of 5 % has "
                "which is told where the error is; no test that has to look for it has more. Errors that show have "
                f"at least {VISIBLE:g}.", "")  # fmt: skip
    pairs = [p for p in judged_runs(rows, "true", "candidate", "hidden") if harmful(p[1])]
    body = []
    for low, high in itertools.pairwise(SIGNALS):
        inside = [(row, run) for row, run in pairs if low <= row["signal"] < high]
        most = [most_power(row["signal"]) for row, _ in inside]
        words = f"{low:g} to {high:g}" if high < float("inf") else f"from {low:g}"
        body.append([
            words, len(inside), f"{100 * np.mean(most):.1f} %" if most else "–", rate(found(run) for _, run in inside),
            rate(refused(run) for _, run in inside),
        ])  # fmt: skip
    yield from _table(["noncentrality", "models", "culprit known", "any of the three", "not accepted"], body)


def _named(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## Standard deviations that are named", "",
                "Right models with a reason about the size of the residuals, and with a standard deviation of each "
                f"kind that is within a factor of {NEAR:g} of that of the noise.", "")  # fmt: skip
    yield from _table(["stated σ", "named"], [[WORDS[s], named_deviations(rows, s)] for s in ("small", "large")])


def _culprits(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## The culprit", "",
                "Of the harmful models whose wrong value is a field of the deck. A field that cannot be told from the "
                "culprit, and a part of its elements, stand for it.", "")  # fmt: skip
    body = [[WORDS[s], ranks(rows, s, 1), ranks(rows, s, 3), signs(rows, s)] for s in STATED]
    yield from _table(["stated σ", "first", "in the first three", "right sign"], body)


def _masses(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## Forgotten masses", "",
                "Of the harmful models that lack a mass: how often a mass at its grid point, or at a neighbourhood "
                "with it, is a suspect, or cannot be told from one.", "")  # fmt: skip
    yield from _table(
        ["stated σ", "first", "in the first three"],
        [[WORDS[s], mass_ranks(rows, s, 1), mass_ranks(rows, s, 3)] for s in STATED],
    )


def _clamps(rows: Sequence[Row]) -> Iterator[str]:
    what = "Of the harmful models whose clamp is elastic in the structure: how often a support is a suspect."
    yield from ("## Elastic clamps", "", what, "")
    yield from _table(
        ["stated σ", "first", "in the first three"],
        [[WORDS[s], support_ranks(rows, s, 1), support_ranks(rows, s, 3)] for s in STATED],
    )


def _coverage(rows: Sequence[Row]) -> Iterator[str]:
    yield from ("## Intervals of 95 % with the truth in them", "",
                "Half widths are medians over the parameters of right models, relative to the truth. Quiet means that "
                "none of the three tests finds something.", "")  # fmt: skip
    body = []
    for s in STATED:
        right, wrong = runs(rows, s, "right"), judged_runs(rows, s, "candidate", "hidden")
        widths = [w for _, run in right for w in half_widths(run)]
        quiet = coverage([p for p in wrong if not found(p[1])])
        kept = coverage([p for p in wrong if not refused(p[1])])
        width = f"{100 * median(widths):.2g} %" if widths else "–"
        body.append([WORDS[s], coverage(right), width, coverage(runs(rows, s, "candidate", "hidden")), kept, quiet])
    heads = ("right models", "half width", "wrong models", "wrong, not refused", "wrong, quiet")
    yield from _table(["stated σ", *heads], body)


def _by_structure(rows: Sequence[Row], started: Sequence[Row]) -> Iterator[str]:
    yield from ("## By structure, true σ", "")
    body = []
    for structure in STRUCTURES:
        own = [row for row in rows if row["structure"] == structure.name]
        wrong = [run for _, run in judged_runs(own, "true", "candidate", "hidden") if harmful(run)]
        body.append([
            structure.name, level(own, "true", found), coverage(runs(own, "true", "right")),
            rate(found_today(run) for run in wrong), rate(found(run) for run in wrong), ranks(own, "true", 1),
            better_minima([row for row in started if row["structure"] == structure.name]),
        ])  # fmt: skip
    heads = ("false alarms", "intervals of right models", "harmful found by goodness of fit", "harmful found",
             "culprit first", "better minimum by starts")  # fmt: skip
    yield from _table(["structure", *heads], body)


def _reasons(rows: Sequence[Row]) -> Iterator[str]:
    counts: Counter[tuple[str, str]] = Counter()
    for row in rows:
        run = row["runs"].get("true")
        if solved(run):
            kind = "right" if row["kind"] == "right" else "harmful" if harmful(run) else "harmless"
            counts.update({(f"{r['code']} ({r['weight']})", kind) for r in reasons(run)})
    if not counts:
        return
    yield from ("## Reasons, true σ", "", "Number of models with a reason of each code. Harmless wrong models miss no "
                "parameter.", "")  # fmt: skip
    kinds = ("right", "harmless", "harmful")
    names = sorted({name for name, _ in counts})
    yield from _table(["reason", *kinds], [[name, *(counts[name, kind] for kind in kinds)] for name in names])


def _failures(rows: Sequence[Row]) -> Iterator[str]:
    errors = Counter(
        f"{row['structure']}: {run['error']}" for row in rows for run in row["runs"].values() if not solved(run)
    )
    endings = Counter(
        f"{row['structure']}: {run['status']}"
        for row in rows for run in row["runs"].values() if solved(run) and not run["ok"]
    )  # fmt: skip
    if errors or endings:
        yield from ("## Runs without a result, or without an optimum", "")
        yield from (f"- {count} × {what}" for what, count in (errors + endings).most_common())
        yield ""


def _revisions(rows: Sequence[Row]) -> str:
    """Of the program, with the number of models if there are several."""
    counts = Counter(row["revision"] for row in rows)
    each = [name if len(counts) == 1 else f"{name} ({count} models)" for name, count in counts.most_common()]
    return f"{femtune.__version__}, commit {', '.join(each)}"


def _machine() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    processor = next(names, platform.processor())
    versions = f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}"
    return f"{processor}, {os.cpu_count()} cores; {versions}"
