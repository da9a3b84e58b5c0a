"""Rules between the keys of [update] and the rest of a study."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.source import StudyLines, is_number, number, table, tables
from femtune.files.study_file.specimens import free_names
from femtune.updating.kinds import WEIGHT_RULES

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

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
