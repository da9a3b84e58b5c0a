"""Rules between the keys of [update] and the rest of a study."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import is_number
from femtune.files.study_file.plain import number, table, tables
from femtune.files.study_file.source import Source

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_WEIGHED = ("minimum-change", "distance", "link", "identical")
_FOUND = ("l-curve", "gcv")


def update_rules(data: Data, source: Source) -> Problems:
    """Weights, names, priors and starts."""
    update = table(data, "update")
    yield from _weight(update, source)
    yield from _of_other_kinds(update, source)
    yield from _names(data, update, source)
    yield from _doubled(update, source)
    if update.get("regularisation") == "prior":
        yield from _means(data, source)
    yield from _starts(data, update, source)


def _weight(update: Data, source: Source) -> Problems:
    kind, weight = update.get("regularisation", "none"), update.get("weight", 0.0)
    if weight in _FOUND:
        fits = kind in _WEIGHED
    elif is_number(weight) and math.isfinite(float(min(weight, 1e300))):
        fits = (weight != 0) == (kind in (*_WEIGHED, "truncated")) and not (kind == "truncated" and weight >= 1)
    else:
        return
    if not fits:
        key = "weight" if "weight" in update else "regularisation"
        shown = {"regularisation": kind, "weight": weight}
        yield source.error(("update", key), "study.weight", _weight_problem(kind), shown, _weight_hint(kind))


def _weight_problem(kind: object) -> str:
    if kind == "truncated":
        return "of a truncated update the weight is the fraction of the largest singular value below which is cut off"
    if kind in _WEIGHED:
        return f'regularisation = "{kind}" does nothing without a weight'
    return 'weight belongs to regularisation = "minimum-change" and its kin, and each needs the other'


def _weight_hint(kind: object) -> str:
    if kind == "truncated":
        return "give weight between 0 and 1, such as 1e-3"
    if kind in _WEIGHED:
        return 'give weight > 0, or weight = "l-curve" or "gcv", which find one'
    return 'give weight > 0 together with "minimum-change", "distance", "link" or "identical", and no weight otherwise'


def _of_other_kinds(update: Data, source: Source) -> Problems:
    """Keys that only one kind of regularisation reads."""
    kind = update.get("regularisation", "none")
    if update.get("adapt") and update.get("weight") not in _FOUND:
        what = "adapt finds the weight again at every iteration, and here no rule finds it"
        hint = 'write weight = "l-curve" or "gcv", or remove adapt'
        yield source.error(("update", "adapt"), "study.regularisation", what, {"weight": update.get("weight")}, hint)
    for key, owner in (("identical", "identical"), ("correlations", "prior")):
        if update.get(key) and kind != owner:
            what = f'{key} belongs to regularisation = "{owner}"'
            hint = f'write regularisation = "{owner}", or remove {key}'
            yield source.error(("update", key), "study.regularisation", what, {"regularisation": kind}, hint)
    if kind == "identical" and not update.get("identical"):
        hint = 'add identical = [["name", "name"]], a list for each group'
        what = 'regularisation = "identical" needs the groups of parameters that are nominally identical'
        yield source.error(("update", "regularisation"), "study.regularisation", what, {}, hint)


def _names(data: Data, update: Data, source: Source) -> Problems:
    free = [e["name"] for _, e in tables(data, "parameter") if isinstance(e.get("name"), str) and "tie" not in e]
    for key, groups in (("identical", update.get("identical")), ("correlations", _pairs(update))):
        for group in groups if isinstance(groups, tuple) else ():
            for name in group if isinstance(group, tuple) else ():
                if isinstance(name, str) and name not in free:
                    what = f"'{name}' is no free parameter"
                    hint = did_you_mean(name, free)
                    yield source.error(("update", key), "update.unknown-parameter", what, {}, hint)


def _pairs(update: Data) -> tuple[tuple[object, object], ...]:
    entries = _tuple(update.get("correlations"))
    return tuple((e.get("one"), e.get("other")) for e in entries if isinstance(e, dict))


def _tuple(value: object) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else ()


def _doubled(update: Data, source: Source) -> Problems:
    """Names twice in a group of identical parameters; a correlation with itself, or of a pair that has one."""
    for number_, group in enumerate(_tuple(update.get("identical"))):
        if isinstance(group, tuple) and all(isinstance(n, str) for n in group) and len(set(group)) < len(group):
            what, hint = "a group of identical parameters names one of them twice", "name each once"
            yield source.error(("update", "identical", number_), "study.regularisation", what, {"group": group}, hint)
    seen: set[frozenset[object]] = set()
    for number_, (one, other) in enumerate(_pairs(update)):
        if not (isinstance(one, str) and isinstance(other, str)):
            continue
        problem = _pair_problem(one, other, seen)
        if problem:
            shown, hint = {"one": one, "other": other}, "give each pair of two parameters one correlation"
            yield source.error(("update", "correlations", number_), "study.regularisation", problem, shown, hint)
        seen.add(frozenset((one, other)))


def _pair_problem(one: str, other: str, seen: set[frozenset[object]]) -> str:
    if one == other:
        return f"'{one}' is fully correlated with itself, and takes no other number"
    return f"the correlation of '{one}' and '{other}' is given twice" if frozenset((one, other)) in seen else ""


def _means(data: Data, source: Source) -> Problems:
    for place, entry in tables(data, "parameter"):
        mean, lower, upper = (number(entry, key) for key in ("mean", "lower", "upper"))
        if mean is not None and lower is not None and upper is not None and not lower <= mean <= upper:
            name = entry.get("name", "")
            what = f"the prior's mean of {name} lies outside its bounds, so that the two contradict each other"
            shown = {"mean": mean, "lower": lower, "upper": upper}
            hint = "widen the bounds, or correct the mean"
            yield source.error((*place, "mean"), "prior.outside-bounds", what, shown, hint)


def _starts(data: Data, update: Data, source: Source) -> Problems:
    several = (number(update, "starts") or 1) > 1
    for key in ("hops", "first"):
        if update.get(key) not in (None, 0, "none") and not several:
            what = f"{key} speaks of several starts, and the update has one"
            yield source.error(("update", key), "study.starts", what, {}, "add starts = 20, or remove the key")
    if update.get("first") == "equation-error" and "reduction" not in data:
        what = 'first = "equation-error" needs reduced models'
        yield source.error(("update", "first"), "study.starts", what, {}, "add a table [reduction], empty or not")
