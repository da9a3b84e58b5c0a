"""[update] and [reduction]: how the parameters are found."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import did_you_mean
from femtune.files.study_file.kinds import Fraction, Seed, Text, TomlTable, Weight
from femtune.files.study_file.source import Data, Problems, StudyLines, is_number, number, table, tables
from femtune.files.study_file.specimens import free_names
from femtune.updating.kinds import WEIGHT_RULES, RegularisationMethod, SearchMethod, WeightTarget


class CorrelationEntry(TomlTable):
    """An entry of [update] correlations: a prior correlation of two parameters."""

    one: Text
    """Name of a parameter. Example: `"k1"`"""
    other: Text
    """Name of the other parameter. Example: `"k2"`"""
    value: Annotated[float, Field(gt=-1, lt=1)]
    """Correlation of their priors, between −1 and 1. Example: `0.8`"""


class UpdateTable(TomlTable):
    """[update]: search, convergence and regularisation."""

    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = 250
    """Iteration limit; the best point is kept. Example: `100`"""
    regularisation: RegularisationMethod = "none"
    """Penalty on the change of the parameters: `"none"`; `"minimum-change"` (of normalised parameters from their
    nominal values); `"distance"` (from the initial values, in prior standard deviations); `"link"` (stronger for
    parameters to which the data are less sensitive); `"prior"` (mean and standard deviation); `"identical"`
    (differences between nominally identical parameters); `"truncated"` (combinations to which the data are insensitive
    are not changed). Example: `"link"`"""
    weight: Weight = 0.0
    """Weight of the regularisation: a number, `"l-curve"` or `"gcv"` (determined at the first iteration and kept); for
    `"truncated"` the fraction of the largest singular value, below 1; not used with `"none"` and `"prior"`. Example:
    `"l-curve"`"""
    weight_on: WeightTarget = "whole-change"
    """For `"minimum-change"`, `"distance"` and `"link"`: the weight acts on the `"whole-change"` of the parameters, or
    on the change of each iteration (`"each-step"`), as printed in the handbook chapter; the result of the latter
    [depends on the number of iterations](theory/regularisation.md). Example: `"each-step"`"""
    adapt: bool = False
    """Determine a weight from a rule again at each iteration. Example: `true`"""
    smallest_change: Annotated[float, Field(ge=0, le=1000)] = 0.25
    """Where the data leave combinations of parameters undetermined, the result is the smallest change from the nominal
    values, in prior standard deviations, whose χ² exceeds the minimum within the bounds by at most this; `0`: the
    minimum itself. Example: `0.0`"""
    identical: tuple[Annotated[tuple[Text, ...], Field(min_length=2)], ...] = ()
    """For `"identical"`: groups of parameters. Example: `[["k1", "k2"]]`"""
    correlations: tuple[CorrelationEntry, ...] = ()
    """For `"prior"`: correlations of the priors of two parameters. Example: `[{ one = "k1", other = "k2", value = 0.8
    }]`"""
    tolerance: Fraction = 1e-8
    """Relative change below which the iteration has converged. Example: `1e-6`"""
    search: SearchMethod = "levenberg-marquardt"
    """Step control: `"levenberg-marquardt"`, `"line-search"`, or `"gauss-newton"` (full steps). Example:
    `"line-search"`"""
    starts: Annotated[int, Field(ge=1, le=100_000)] = 1
    """Number of initial points of a multi-start update, from a Latin hypercube within the bounds. Example: `20`"""
    seed: Seed = 0
    """Seed of the random numbers. Example: `1`"""
    hops: Annotated[int, Field(ge=0, le=1000)] = 0
    """How many times a start that ended at a worse minimum than the best is restarted. Example: `2`"""
    samples: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    """Evaluate the objective at so many points of the hypercube and start from the initial values and the best `starts`
    − 1 of them; 0: the starts are the points of the hypercube. Example: `100`"""
    first: Literal["none", "equation-error"] = "none"
    """`"equation-error"`: each start first minimises the equation error of the test modes, which needs no pairing;
    requires `[reduction]`. `"none"`: the residuals from the start. Example: `"equation-error"`"""

    look_further: bool = True
    """`false`: the end of the update is not doubted by further updates: no other pairings or starts are tried, and no
    field that may be missing is made a parameter. For updates in a loop; the verdict has a reservation. Example:
    `false`"""


class ReductionTable(TomlTable):
    """[reduction]: the update searches on reduced models and is certified on the full one."""

    tolerance: Annotated[float, Field(gt=0, lt=0.1)] = 1e-4
    """Largest relative difference between a frequency of the reduced and of the full model at the end; during the
    update it may be ten times larger; above 0, below 0.1. Example: `1e-3`"""
    full_solutions: Annotated[int, Field(ge=4, le=10_000)] = 20
    """Largest number of solutions of the full model, for each configuration, and of points at which its components are
    computed; 4 to 10,000. Example: `30`"""
    order: Annotated[int, Field(ge=10, le=20_000)] = 600
    """Largest order of each reduced model; 10 to 20,000. Example: `1000`"""
    frf_tolerance: Annotated[float, Field(gt=0, lt=10)] = 0.01
    """How far the difference between the FRFs of the reduced and of the full model may move the parameters at the end,
    in their standard deviations; above 0, below 10. Example: `0.05`"""


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of [update] and the rest of a study.

_WEIGHTED_KINDS = ("minimum-change", "distance", "link", "identical")
"""Kinds of regularisation that need a weight."""
_KINDS_OF_STEPS = ("minimum-change", "distance", "link")
"""Kinds of regularisation whose weight may act on each step instead of the whole change."""


def update_rules(data: Data, source: StudyLines) -> Problems:
    """Check weights, names, priors and starts."""
    update = table(data, "update")
    yield from _weight(update, source)
    yield from _of_other_kinds(update, source)
    yield from _names(data, update, source)
    yield from _doubled(update, source)
    if update.get("regularisation") == "prior":
        yield from _means(data, source)
    yield from _starts(data, update, source)


def _weight(update: Data, source: StudyLines) -> Problems:
    kind, weight = update.get("regularisation", "none"), update.get("weight", 0.0)
    if weight in WEIGHT_RULES:
        fits = kind in _WEIGHTED_KINDS
    elif is_number(weight) and math.isfinite(float(min(weight, 1e300))):
        fits = (weight != 0) == (kind in (*_WEIGHTED_KINDS, "truncated")) and not (kind == "truncated" and weight >= 1)
    else:
        return
    if not fits:
        key = "weight" if "weight" in update else "regularisation"
        shown = {"regularisation": kind, "weight": weight}
        code = "study.weight/missing" if kind in _WEIGHTED_KINDS else "study.weight"
        code = "study.weight/truncated" if kind == "truncated" else code
        yield source.error(("update", key), code, shown, regularisation=kind)


def _of_other_kinds(update: Data, source: StudyLines) -> Problems:
    """Keys that only one kind of regularisation reads."""
    kind = update.get("regularisation", "none")
    if update.get("adapt") and update.get("weight") not in WEIGHT_RULES:
        yield source.error(("update", "adapt"), "study.regularisation/adapt", {"weight": update.get("weight")})
    if update.get("weight_on") == "each-step" and kind not in _KINDS_OF_STEPS:
        yield source.error(("update", "weight_on"), "study.regularisation/each-step", {"regularisation": kind})
    for key, owner in (("identical", "identical"), ("correlations", "prior")):
        if update.get(key) and kind != owner:
            yield source.error(
                ("update", key), "study.regularisation/other-kind", {"regularisation": kind}, key=key, owner=owner
            )
    if kind == "identical" and not update.get("identical"):
        yield source.error(("update", "regularisation"), "study.regularisation/no-groups", {})


def _names(data: Data, update: Data, source: StudyLines) -> Problems:
    free = free_names(data)
    for key, groups in (("identical", update.get("identical")), ("correlations", _pairs(update))):
        for group in groups if isinstance(groups, tuple) else ():
            for name in group if isinstance(group, tuple) else ():
                if isinstance(name, str) and name not in free:
                    hint = did_you_mean(name, free)
                    yield source.error(
                        ("update", key), "update.unknown-parameter/in-study", {}, hint=hint, parameter=name
                    )


def _pairs(update: Data) -> tuple[tuple[object, object], ...]:
    entries = _tuple(update.get("correlations"))
    return tuple((e.get("one"), e.get("other")) for e in entries if isinstance(e, dict))


def _tuple(value: object) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else ()


def _doubled(update: Data, source: StudyLines) -> Problems:
    """Refuse repeated names in a group of identical parameters, and correlations of a parameter with itself or given
    twice."""
    for number_, group in enumerate(_tuple(update.get("identical"))):
        if isinstance(group, tuple) and all(isinstance(n, str) for n in group) and len(set(group)) < len(group):
            yield source.error(("update", "identical", number_), "study.regularisation/named-twice", {"group": group})
    seen: set[frozenset[object]] = set()
    for number_, (one, other) in enumerate(_pairs(update)):
        if not (isinstance(one, str) and isinstance(other, str)):
            continue
        if one == other or frozenset((one, other)) in seen:
            code = "study.regularisation/self-correlation" if one == other else "study.regularisation/correlation-twice"
            shown = {"one": one, "other": other}
            yield source.error(("update", "correlations", number_), code, shown, one=one, other=other)
        seen.add(frozenset((one, other)))


def _means(data: Data, source: StudyLines) -> Problems:
    for place, entry in tables(data, "parameter"):
        mean, lower, upper = (number(entry, key) for key in ("mean", "lower", "upper"))
        if mean is not None and lower is not None and upper is not None and not lower <= mean <= upper:
            name = entry.get("name", "")
            shown = {"mean": mean, "lower": lower, "upper": upper}
            yield source.error((*place, "mean"), "prior.outside-bounds/in-study", shown, parameter=name)


def _starts(data: Data, update: Data, source: StudyLines) -> Problems:
    several = (number(update, "starts") or 1) > 1
    if update.get("weight_on") == "each-step":
        for word, given in (("starts", several), ("[reduction]", "reduction" in data)):
            if given:
                yield source.error(("update", "weight_on"), "study.regularisation/each-step-alone", {}, other=word)
    for key in ("hops", "samples", "first"):
        if update.get(key) not in (None, 0, "none") and not several:
            yield source.error(("update", key), "study.starts/one-start", {}, key=key)
    samples, starts = number(update, "samples") or 0, number(update, "starts") or 1
    if several and 0 < samples < starts:
        yield source.error(("update", "samples"), "study.starts/few-samples", {}, samples=samples, starts=starts)
    if update.get("first") == "equation-error" and "reduction" not in data:
        yield source.error(("update", "first"), "study.starts/needs-reduction", {})
