"""Rules between the keys of [residuals] and [[residual]], and between them and the configurations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.lines import Place
from femtune.files.study_file.plain import number, table, tables
from femtune.files.study_file.source import Source

Data = dict[str, Any]
Problems = Iterator[FemtuneError]

BY_SD_OR_COVARIANCE = ("frequency", "shape", "strain", "static-displacement")
"""Kinds that are weighted by a standard deviation or by a covariance."""


def residual_rules(data: Data, source: Source) -> Problems:
    """All breaches."""
    yield from _modes(data, source)
    for place, entry in tables(data, "residual"):
        yield from _configuration(data, place, entry, source)
        yield from _weights(place, entry, source)
        yield from _functions(place, entry, source)


def _modes(data: Data, source: Source) -> Problems:
    residuals = table(data, "residuals")
    silent = number(residuals, "frequency_sd") == 0 and not residuals.get("shape_sd")
    if silent and not data.get("residual"):
        what = "neither frequencies nor shapes are compared"
        hint = "give frequency_sd or shape_sd a value above zero, or add a [[residual]]"
        yield source.error(("residuals", "frequency_sd"), "study.nothing-compared", what, residuals, hint)


def _configuration(data: Data, place: Place, entry: Data, source: Source) -> Problems:
    known = {str(c.get("name")): c for _, c in tables(data, "configuration")}
    name = entry.get("configuration")
    if name is None:
        if len(known) > 1:
            what = "the study has several configurations, and this residual does not say to which it belongs"
            hint = f'add configuration = "{next(iter(known))}"'
            yield source.error(place, "study.residual-configuration", what, {"configurations": list(known)}, hint)
        return
    where = (*place, "configuration")
    if known and isinstance(name, str) and name not in known:
        what = f"no configuration is called '{name}'"
        yield source.error(where, "study.residual-configuration", what, {}, did_you_mean(name, known))
    elif not known:
        what, hint = "the study has no [[configuration]] that a residual could name", "leave this key out"
        yield source.error(where, "study.residual-configuration", what, {}, hint)
    elif known.get(str(name), {}).get("use") == "validation":
        what = f"configuration {name} is kept for validation, so the update does not use this residual"
        hint = "name a configuration that the update uses, or take the residual out"
        yield source.error(where, "study.residual-configuration", what, {}, hint)


def _weights(place: Place, entry: Data, source: Source) -> Problems:
    both = [key for key in ("sd", "covariance") if key in entry]
    if entry.get("kind") in BY_SD_OR_COVARIANCE and len(both) != 1:
        what = "a residual is weighted by sd or by covariance, and this one has " + ("both" if both else "neither")
        hint = "keep one of the two" if both else "add sd = 0.01, the scatter of what was measured"
        yield source.error((*place, *both[-1:]), "residual.weights", what, {}, hint)
    if entry.get("covariance") == "test" and entry.get("kind") != "frequency":
        what = "a test gives the covariance of its frequencies only"
        hint = "write the matrix, or give sd"
        yield source.error((*place, "covariance"), "residual.weights", what, {}, hint)
    if number(entry, "sd") == 0:
        what = "a standard deviation of zero would weigh without limit"
        hint = "give the scatter of what was measured, or take the residual out"
        yield source.error((*place, "sd"), "residual.zero-variance", what, {"sd": entry["sd"]}, hint)


_AROUND_RESONANCES = ("modes", "bandwidths", "lines", "aligned", "region_ratio")


def _functions(place: Place, entry: Data, source: Source) -> Problems:
    """Keys of measured FRFs that exclude each other."""
    if entry.get("kind") not in ("frf", "antiresonance"):
        return
    low, high = number(entry, "from_hz") or 0.0, number(entry, "to_hz")
    if high is not None and low >= high:
        what, hint = "the band does not rise from from_hz to to_hz", "let to_hz be the larger one"
        yield source.error((*place, "to_hz"), "study.response-lines", what, {"from_hz": low, "to_hz": high}, hint)
    for one, other, code in (("count", "max_hz", "study.modes"), ("ratio", "ratios", "study.response-ratios")):
        if one in entry and other in entry:
            what = f"a residual has both {one} and {other}"
            yield source.error((*place, other), code, what, {}, f"keep {one} or {other}")
    around = entry.get("around", "band")
    unused = ("from_hz", "to_hz", "most") if around == "resonances" else _AROUND_RESONANCES
    for key in unused if entry["kind"] == "frf" else ():
        if key in entry:
            what = f"'{key}' says nothing of lines around {'resonances' if around == 'resonances' else 'no resonance'}"
            hint = "leave it out" if around == "resonances" else 'add around = "resonances", or leave it out'
            yield source.error((*place, key), "study.residual-lines", what, {"around": around}, hint)
