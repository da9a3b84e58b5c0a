"""Rules between [[stage]] and the tables that it names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import is_number
from femtune.files.study_file.lines import Place
from femtune.files.study_file.plain import named_twice, table, tables, texts
from femtune.files.study_file.source import Source

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

BY_THEMSELVES = ("frequency", "shape", "resonances")
"""Kinds of residual that need no [[residual]]: the first two as [residuals] says, the last of measured FRFs."""

_OF_ONE_UPDATE = ("starts", "seed", "hops", "first")


def stage_rules(data: Data, source: Source) -> Problems:
    """All breaches."""
    entries = list(tables(data, "stage"))
    yield from named_twice(entries, "study.duplicate-name", source)
    if entries:
        yield from _update(data, source)
    for place, entry in entries:
        yield from _names((*place, "configurations"), entry, _configurations(data), "configuration", source)
        yield from _names((*place, "parameters"), entry, _parameters(data), "free parameter", source)
        yield from _names((*place, "residuals"), entry, _kinds(data), "kind of residual of this study", source)
        yield from _doubled((*place, "parameters"), entry, source)
        yield from _seeds(place, entry, data, source)


def _update(data: Data, source: Source) -> Problems:
    update = table(data, "update")
    if update.get("regularisation", "none") != "none":
        what = "[update] asks for a side constraint, and a study of stages has its own: what earlier stages believe"
        hint = "leave regularisation out; prior = false in a [[stage]] starts it without a prior"
        yield source.error(("update", "regularisation"), "study.stage", what, {}, hint)
    for key in _OF_ONE_UPDATE:
        if key in update:
            what = f"'{key}' in [update] has no meaning in a study of stages"
            yield source.error(
                ("update", key), "study.stage", what, {}, "leave it out; seeds in a [[stage]] are starts"
            )
    if "reduction" in data:
        what = "a study of stages is not searched on reduced models"
        yield source.error(("reduction",), "study.stage", what, {}, "take [reduction] out, or the stages")


def _configurations(data: Data) -> list[str]:
    found = [entry for _, entry in tables(data, "configuration") if entry.get("use", "update") != "validation"]
    return [str(entry.get("name")) for entry in found]


def _parameters(data: Data) -> list[str]:
    return [str(entry.get("name")) for _, entry in tables(data, "parameter") if "tie" not in entry]


def _kinds(data: Data) -> list[str]:
    return [*BY_THEMSELVES, *dict.fromkeys(str(entry.get("kind")) for _, entry in tables(data, "residual"))]


def _names(place: Place, entry: Data, known: list[str], what: str, source: Source) -> Problems:
    for i, name in enumerate(texts(entry.get(str(place[-1])))):
        if name not in known:
            yield source.error((*place, i), "study.stage", f"'{name}' is no {what}", {}, did_you_mean(name, known))


def _doubled(place: Place, entry: Data, source: Source) -> Problems:
    names = texts(entry.get("parameters"))
    for name in dict.fromkeys(n for n in names if names.count(n) > 1):
        yield source.error(place, "study.stage", f"'{name}' stands twice in a stage", {}, "name each parameter once")


def _seeds(place: Place, entry: Data, data: Data, source: Source) -> Problems:
    bounds = {str(p.get("name")): (p.get("lower"), p.get("upper")) for _, p in tables(data, "parameter")}
    seeds = entry.get("seeds", ())
    for i, seed in enumerate(seeds if isinstance(seeds, tuple) else ()):
        for name, value in seed.items() if isinstance(seed, dict) else ():
            where = (*place, "seeds", i)
            if name not in texts(entry.get("parameters")):
                what, hint = f"the seed names '{name}', which this stage does not move", "seeds are start values"
                yield source.error(where, "study.stage", what, {}, hint)
            elif not _inside(value, bounds.get(name, (None, None))):
                what = f"the seed starts {name} outside its bounds"
                yield source.error(where, "study.stage", what, {name: value}, "give a value between lower and upper")


def _inside(value: object, bounds: tuple[object, object]) -> bool:
    """True also where a type is wrong, which the models judge."""
    if not all(map(is_number, (value, *bounds))):
        return True
    return bounds[0] <= value <= bounds[1]  # type: ignore[operator]
