"""Rules between the keys of the parameters of a study."""

from __future__ import annotations

import keyword
from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.lines import Place
from femtune.files.study_file.plain import named_twice, number, tables
from femtune.files.study_file.source import Source
from femtune.parameters import parse_expression

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_LEAST_PRIOR = 1e-9
"""Prior standard deviation over the width of the bounds, at least; its square stays clear of rounding."""
_OF_FREE_ONES = ("lower", "upper", "nominal", "sd", "mean", "prior")


def parameter_rules(data: Data, source: Source) -> Problems:
    """Names, bounds and ties."""
    entries = list(tables(data, "parameter"))
    yield from named_twice(entries, "parameter.duplicate", source)
    names = [entry["name"] for _, entry in entries if isinstance(entry.get("name"), str)]
    for place, entry in entries:
        yield from _name(place, entry, source)
        if "tie" in entry:
            yield from _tied(place, entry, names, source)
        else:
            yield from _bounds(place, entry, source)
            yield from _prior_sd(place, entry, source)
            yield from _catalogue(place, entry, source)


def _name(place: Place, entry: Data, source: Source) -> Problems:
    name = entry.get("name")
    if isinstance(name, str) and name and (not name.isidentifier() or keyword.iskeyword(name)):
        hint = "letters, digits and _, no digit first, and no word of Python such as 'if'"
        what = f"'{name}' is not a name that a tie can use"
        yield source.error((*place, "name"), "parameter.name", what, {}, hint)


def _tied(place: Place, entry: Data, names: list[str], source: Source) -> Problems:
    for key in _OF_FREE_ONES:
        if key in entry:
            what = f"a tied parameter has no '{key}': it follows the others"
            yield source.error((*place, key), "parameter.tied", what, {key: entry[key]}, "remove the key, or the tie")
    for name in _names_in(entry["tie"]):
        if name not in names:
            what = f"the tie names '{name}', which is no parameter"
            hint = did_you_mean(name, (n for n in names if n != entry.get("name")))
            yield source.error((*place, "tie"), "tie.unknown", what, {"tie": entry["tie"]}, hint)


def _names_in(tie: object) -> tuple[str, ...]:
    """Names in a tie that can be read; the models say what is wrong with the others."""
    try:
        return parse_expression(tie).names if isinstance(tie, str) else ()
    except FemtuneError:
        return ()


def _catalogue(place: Place, entry: Data, source: Source) -> Problems:
    """A prior from a catalogue stands alone, and is of the field itself."""
    if "prior_name" in entry and "prior" not in entry:
        what = "prior_name names an entry of a catalogue, and no catalogue is given"
        yield source.error((*place, "prior_name"), "parameter.prior", what, {}, 'add prior = "damping.toml"')
    if "prior" not in entry:
        return
    for key in ("mean", "sd"):
        if key in entry:
            what = f"the catalogue gives the prior, and '{key}' gives it too"
            yield source.error((*place, key), "parameter.prior", what, {key: entry[key]}, "keep one of the two")
    if entry.get("absolute") is not True:
        what = "a catalogue holds values of the field itself, and this parameter is a factor"
        yield source.error((*place, "prior"), "parameter.prior", what, {}, "add absolute = true")


def _bounds(place: Place, entry: Data, source: Source) -> Problems:
    for key in ("lower", "upper"):
        if key not in entry:
            what = f"the free parameter '{entry.get('name', '')}' lacks '{key}'"
            hint = f"add the line  {key} = …  or tie the parameter to others"
            yield source.error((*place, key), "study.missing-key", what, {}, hint)
    lower, upper = number(entry, "lower"), number(entry, "upper")
    if lower is None or upper is None:
        return
    if lower >= upper:
        yield _bad_bounds(place, entry, source)
    elif (start := _start(entry)) is not None and not lower <= start <= upper:
        shown = {"nominal": start, "lower": lower, "upper": upper}
        key = "nominal" if "nominal" in entry else "lower"
        what = f"parameter '{entry.get('name', '')}': the nominal value lies outside the bounds"
        yield source.error((*place, key), "parameter.bounds", what, shown, "widen the bounds, or change the nominal")


def _prior_sd(place: Place, entry: Data, source: Source) -> Problems:
    """A prior that is narrower or wider than numbers beside the bounds can tell is none."""
    lower, upper, sd = (number(entry, key) for key in ("lower", "upper", "sd"))
    if lower is None or upper is None or sd is None or not lower < upper or sd <= 0.0:
        return
    if not _LEAST_PRIOR <= sd / (upper - lower) <= 1.0 / _LEAST_PRIOR:
        what = f"the prior's standard deviation of {entry.get('name', '')} is of another size than its bounds"
        shown = {"sd": sd, "lower": lower, "upper": upper}
        hint = "give what is known of the parameter, in its own unit; fix one that is known exactly"
        yield source.error((*place, "sd"), "study.value", what, shown, hint)


def _start(entry: Data) -> float | None:
    """The nominal value as far as the study tells: that of an absolute parameter may be the deck's."""
    if "nominal" in entry:
        return number(entry, "nominal")
    return None if entry.get("absolute") else 1.0


def _bad_bounds(place: Place, entry: Data, source: Source) -> FemtuneError:
    shown = {"lower": entry["lower"], "upper": entry["upper"]}
    same = entry["lower"] == entry["upper"]
    problem = "the bounds leave no room" if same else "the lower bound lies above the upper one"
    hint = "widen them, or leave the parameter out" if same else "exchange them"
    what = f"parameter '{entry.get('name', '')}': {problem}"
    return source.error((*place, "lower"), "parameter.bounds", what, shown, hint)
