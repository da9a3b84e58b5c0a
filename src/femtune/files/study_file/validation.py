"""[validate], [[hold_out]] and [checks]: data held out of the update, and acceptance criteria."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import DofLabel, Positive, Text, TomlTable
from femtune.files.study_file.response import HertzAboveZero
from femtune.files.study_file.source import Place, StudyLines, number, table, tables
from femtune.identification.kinds import ChannelRule
from femtune.validation.kinds import ProfileWord

Fraction = Annotated[float, Field(gt=0, lt=1)]


class HoldOutEntry(TomlTable):
    """[[hold_out]]: modes, sensors and FRFs of a test that the update does not use."""

    configuration: Text | None = None
    modes: tuple[Text, ...] = ()
    above_hz: Positive | None = None
    below_hz: Positive | None = None
    sensors: tuple[DofLabel, ...] = ()
    outputs: tuple[DofLabel, ...] = ()
    inputs: tuple[DofLabel, ...] = ()
    worst: Annotated[int, Field(ge=1, le=100_000)] | None = None
    by: ChannelRule | None = None


class ValidateTable(TomlTable):
    """[validate]: criteria of a standard or of the user, and the standard deviations of the test."""

    profile: ProfileWord = "all"
    frequency_error: Fraction | None = None
    mac: Fraction | None = None
    cross_orthogonality: Fraction | None = None
    off_diagonal: Fraction | None = None
    shape_error: Fraction | None = None
    frac: Fraction | None = None
    fdac: Fraction | None = None
    frf_mean_db: Positive | None = None
    frf_max_db: Positive | None = None
    resonance_error: Fraction | None = None
    sweep_frequency: Fraction | None = None
    sweep_amplitude: Fraction | None = None
    random_rms: Fraction | None = None
    transient_peak: Fraction | None = None
    frf_from_hz: HertzAboveZero | None = None
    frf_to_hz: HertzAboveZero | None = None
    frequency_sd: Fraction | None = None
    shape_sd: Fraction | None = None

    @property
    def own_limits(self) -> dict[str, float]:
        """User-defined limits by key."""
        found = {name: getattr(self, name) for name in OWN_LIMITS}
        return {name: value for name, value in found.items() if value is not None}


class ChecksTable(TomlTable):
    """[checks]: checks of the model before the update."""

    refinement: bool | None = None
    mesh_error: Fraction = 0.02
    mass_error: Fraction = 0.02


FRF_LIMITS = ("frac", "fdac", "frf_mean_db", "frf_max_db", "resonance_error")
"""Keys of [validate] that are limits of criteria on FRFs."""
VIBRATION_LIMITS = ("sweep_frequency", "sweep_amplitude", "random_rms", "transient_peak")
"""Keys of [validate] that are limits of criteria on vibration tests."""
OWN_LIMITS = (
    "frequency_error", "mac", "cross_orthogonality", "off_diagonal", "shape_error", *FRF_LIMITS, *VIBRATION_LIMITS,
)  # fmt: skip
"""Keys of [validate] that are limits of criteria."""


# ----------------------------------------------------------------------------------------------------
# Rules between the keys of [validate] and [[hold_out]].


Data = dict[str, Any]
Problems = Iterator[FemtuneError]

_WHAT = ("modes", "above_hz", "below_hz", "sensors", "outputs", "inputs", "worst")


def validation_rules(data: Data, source: StudyLines) -> Problems:
    """User-defined criteria require limits; held-out data must exist and belong to the update."""
    validate = table(data, "validate")
    if validate.get("profile") == "own" and not any(key in validate for key in OWN_LIMITS):
        yield source.error(("validate", "profile"), "study.no-criteria", {})
    low, high = number(validate, "frf_from_hz"), number(validate, "frf_to_hz")
    if low is not None and high is not None and low >= high:
        shown = {"frf_from_hz": low, "frf_to_hz": high}
        yield source.error(("validate", "frf_to_hz"), "study.response-lines/validation", shown)
    configurations = {e["name"]: e for _, e in tables(data, "configuration") if isinstance(e.get("name"), str)}
    for place, entry in tables(data, "hold_out"):
        if not any(entry.get(key) for key in _WHAT):
            yield source.error(place, "study.hold-out/nothing-named", {})
        if "by" in entry and "worst" not in entry:
            yield source.error((*place, "by"), "study.hold-out/by", {})
        if "worst" in entry and (entry.get("outputs") or entry.get("inputs")):
            yield source.error((*place, "worst"), "study.hold-out/worst-and-named", {})
        yield from _configuration(place, entry, configurations, source)


def _configuration(place: Place, entry: Data, known: dict[str, Data], source: StudyLines) -> Problems:
    name = entry.get("configuration")
    if not isinstance(name, str):
        return
    if name not in known:
        hint = did_you_mean(name, known) or "remove the key, which is for studies with several configurations"
        yield source.error((*place, "configuration"), "study.hold-out/unknown-configuration", {}, hint=hint, name=name)
    elif "test" not in known[name]:
        yield source.error((*place, "configuration"), "study.hold-out/without-test", {}, name=name)
    elif known[name].get("use") == "validation":
        yield source.error((*place, "configuration"), "study.hold-out/for-validation", {}, name=name)
