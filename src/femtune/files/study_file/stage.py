"""[[stage]]: a stage of a bottom-up update; stages run in the order of the file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.errors import did_you_mean
from femtune.files.study_file.kinds import Fraction, Hertz, HertzAboveZero, NotNegative, Positive, Text, TomlTable
from femtune.files.study_file.source import (
    Data,
    Place,
    Problems,
    StudyLines,
    is_number,
    named_twice,
    number,
    table,
    tables,
    texts,
)
from femtune.files.study_file.specimens import bounds_of, free_names

Names = Annotated[tuple[Text, ...], Field(min_length=1)]


class ByHandEntry(TomlTable):
    """A parameter that gets a value before a stage: the `value` itself, or what is to `add` to the present one."""

    parameter: Text
    """Name of a free parameter; an individual one stands for those of all specimens. Example: `"k_rubber"`"""
    value: float | None = None
    """Value of the parameter, in its unit. Give either `value` or `add`. Example: `4.8`"""
    add: float | None = None
    """What is added to the value from earlier stages, instead of `value`. Example: `2.0`"""
    sd: Positive | None = None
    """Standard deviation of the value. Default: that of the prior of the parameter. Example: `0.5`"""
    reason: Text
    """The reason; listed in the report. Example: `"rubber is stiffer above 300 Hz"`"""


class StageEntry(TomlTable):
    """Parameters, residuals, band, values set by hand and further initial values of a stage."""

    name: Text
    """Name of the stage, unique. Example: `"front, damping"`"""
    parameters: Names
    """Free parameters that are updated; the others are fixed at the results of earlier stages. Example:
    `["E_front"]`"""
    residuals: Names
    """Kinds that are compared: `"frequency"` and `"shape"` as in `[residuals]`, `"resonances"`: measured FRFs around
    the resonances of paired modes, and the kinds of the study's `[[residual]]` tables. Example: `["mass"]`"""
    configurations: Names | None = None
    """Configurations that are compared. Default: all that are used in the update. Example: `["front part"]`"""
    from_hz: Hertz = 0.0
    """Lowest frequency that is compared: of test modes, FRF lines and antiresonances, Hz. Example: `60.0`"""
    to_hz: HertzAboveZero | None = None
    """Highest frequency that is compared: of test modes, FRF lines and antiresonances, Hz. Default: no limit. Example:
    `265.0`"""
    by_hand: tuple[ByHandEntry, ...] = ()
    """Values that parameters get before the stage, each with the reason. Example: `[{ parameter = "k", value = 4.8,
    reason = "data sheet" }]`"""
    seeds: tuple[dict[Text, float], ...] = ()
    """Further initial values of the parameters of the stage, in their units; the stage is run from each, and the best
    result is used. Example: `[{ eta = 0.003 }, { eta = 0.03 }]`"""
    frf_sd: Positive = 0.05
    """For `"resonances"`: standard deviation of real and imaginary part, relative to the magnitude. Example: `0.03`"""
    frf_floor: NotNegative = 0.0
    """For `"resonances"`: standard deviation of the noise floor, relative to the largest magnitude of each FRF.
    Example: `1e-4`"""
    prior: bool = True
    """Use the results of earlier stages and the priors of the parameters; `false`: use only the data of the stage.
    Example: `false`"""
    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """Iteration limit of the stage. Default: the value in `[update]`. Example: `30`"""
    tolerance: Fraction | None = None
    """Relative change below which the iteration of the stage has converged. Default: the value in `[update]`. Example:
    `1e-6`"""

    @property
    def band_hz(self) -> tuple[float, float] | None:
        """The frequencies that are compared; None for all."""
        if not self.from_hz and self.to_hz is None:
            return None
        return self.from_hz, float("inf") if self.to_hz is None else self.to_hz


# ----------------------------------------------------------------------------------------------------
# Rules between [[stage]] and the tables that it names.


RESONANCES = "resonances"
"""Name for measured FRFs in the resonance regions of paired modes, which a stage may compare besides residuals."""
BY_THEMSELVES = ("frequency", "shape", RESONANCES)
"""Comparisons that need no [[residual]]; the first two are those of [residuals]."""

_KEYS_OF_ONE_UPDATE = ("starts", "seed", "hops", "first")
"""Keys of [update] that exclude stages."""


def stage_rules(data: Data, source: StudyLines) -> Problems:
    """All violated rules."""
    entries = list(tables(data, "stage"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    if entries:
        yield from _update(data, source)
    for place, entry in entries:
        yield from _names((*place, "configurations"), entry, _configurations(data), "configuration", source)
        yield from _names((*place, "parameters"), entry, free_names(data), "free parameter", source)
        yield from _names((*place, "residuals"), entry, _kinds(data), "kind of residual of this study", source)
        yield from _doubled((*place, "parameters"), entry, source)
        yield from _seeds(place, entry, data, source)
        yield from _band(place, entry, source)
        yield from _by_hand(place, entry, data, source)


def _update(data: Data, source: StudyLines) -> Problems:
    update = table(data, "update")
    if update.get("regularisation", "none") != "none":
        yield source.error(("update", "regularisation"), "study.stage/regularisation", {})
    for key in _KEYS_OF_ONE_UPDATE:
        if key in update:
            yield source.error(("update", key), "study.stage/key-of-update", {}, key=key)


def _configurations(data: Data) -> list[str]:
    entries = [entry for _, entry in tables(data, "configuration") if entry.get("use", "update") != "validation"]
    return [str(entry.get("name")) for entry in entries]


def _kinds(data: Data) -> list[str]:
    return [*BY_THEMSELVES, *dict.fromkeys(str(entry.get("kind")) for _, entry in tables(data, "residual"))]


def _names(place: Place, entry: Data, known: list[str], what: str, source: StudyLines) -> Problems:
    for i, name in enumerate(texts(entry.get(str(place[-1])))):
        if name not in known:
            yield source.error(
                (*place, i),
                "study.stage/unknown-name",
                {},
                hint=did_you_mean(name, known),
                name=name,
                kind_of_name=what,
            )


def _doubled(place: Place, entry: Data, source: StudyLines) -> Problems:
    names = texts(entry.get("parameters"))
    for name in dict.fromkeys(n for n in names if names.count(n) > 1):
        yield source.error(place, "study.stage/doubled", {}, name=name)


def _seeds(place: Place, entry: Data, data: Data, source: StudyLines) -> Problems:
    bounds = bounds_of(data)
    seeds = entry.get("seeds", ())
    for i, seed in enumerate(seeds if isinstance(seeds, tuple) else ()):
        for name, value in seed.items() if isinstance(seed, dict) else ():
            where = (*place, "seeds", i)
            if name not in texts(entry.get("parameters")):
                yield source.error(where, "study.stage/seed-parameter", {}, name=name)
            elif not _inside(value, bounds.get(name, (None, None))):
                yield source.error(where, "study.stage/seed-outside-bounds", {name: value}, name=name)


def _band(place: Place, entry: Data, source: StudyLines) -> Problems:
    low, high = number(entry, "from_hz") or 0.0, number(entry, "to_hz")
    if high is not None and low >= high:
        yield source.error((*place, "to_hz"), "study.stage/band", {"from_hz": low, "to_hz": high})


def _by_hand(place: Place, entry: Data, data: Data, source: StudyLines) -> Problems:
    known, bounds, seen = free_names(data), bounds_of(data), set[str]()
    for at, one in tables(entry, "by_hand"):
        where, name = (*place, *at), one.get("parameter")
        if ("value" in one) == ("add" in one):
            yield source.error(where, "study.stage/value-or-add", {})
        if not isinstance(name, str):
            continue
        if name not in known:
            what, hint = "free parameter", did_you_mean(name, known)
            yield source.error(
                (*where, "parameter"), "study.stage/unknown-name", {}, hint=hint, name=name, kind_of_name=what
            )
        elif "value" in one and not _inside(one["value"], bounds[name]):
            yield source.error(where, "study.stage/by-hand-outside-bounds", {name: one["value"]}, name=name)
        if name in seen:
            yield source.error(where, "study.stage/by-hand-twice", {}, name=name)
        seen.add(name)


def _inside(value: object, bounds: tuple[object, object]) -> bool:
    """True also for values of the wrong type, which are reported elsewhere."""
    if not all(map(is_number, (value, *bounds))):
        return True
    return bounds[0] <= value <= bounds[1]  # type: ignore[operator]
