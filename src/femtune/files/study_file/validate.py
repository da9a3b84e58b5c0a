"""[validate], [[hold_out]] and [checks]: data held out of the update, and acceptance criteria."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from femtune.errors import did_you_mean
from femtune.files.study_file.kinds import DofLabel, Fraction, HertzAboveZero, Positive, Text, TomlTable
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, number, table, tables
from femtune.identification.kinds import ChannelRule
from femtune.validation.kinds import ProfileWord


class HoldOutEntry(TomlTable):
    """[[hold_out]]: modes, sensors and FRFs of a test that the update does not use."""

    configuration: Text | None = None
    """Name of the configuration. Default: all that are used in the update. Example: `"free"`"""
    modes: tuple[Text, ...] = ()
    """Labels of test modes. Example: `["7", "8"]`"""
    above_hz: Positive | None = None
    """All modes above this frequency, Hz. Example: `80.0`"""
    below_hz: Positive | None = None
    """All modes below this frequency, Hz. Example: `5.0`"""
    sensors: tuple[DofLabel, ...] = ()
    """Degrees of freedom of the test modes. Example: `["12Z+", "112Z+"]`"""
    outputs: tuple[DofLabel, ...] = ()
    """Response DOFs of measured FRFs: all FRFs of these outputs, or those between them and `inputs`, if both keys are
    given. Example: `["12Z+"]`"""
    inputs: tuple[DofLabel, ...] = ()
    """Reference DOFs of measured FRFs: all FRFs of these inputs, or those between them and `outputs`, if both keys are
    given. Example: `["3Z+"]`"""
    worst: Annotated[int, Field(ge=1, le=100_000)] | None = None
    """Hold out the FRFs of so many outputs, the worst ones; a notice names them. If the test has one output and several
    inputs, they are the worst inputs. Example: `18`"""
    by: ChannelRule | None = None
    """What makes a channel bad: the lowest mean `"coherence"`, the highest relative `"noise"` between neighbouring
    lines, or the largest error of an identified system (`"fit"`, with the options of [`[equalise]`](#equalise)).
    Default: coherence if the test has it. Example: `"fit"`"""


class ValidateTable(TomlTable):
    """[validate]: criteria of a standard or of the user, and the standard deviations of the test."""

    profile: ProfileWord = "all"
    """The standard whose criteria the model must meet: `"NASA"` (NASA-STD-5002), `"MIL"` (MIL-STD-1540C), `"ECSS"`
    (ECSS-E-ST-32-11C), or `"own"`: only the limits in this table. With `"all"`, no standard is chosen: the criteria of
    all three are listed, and the [verdict](guide/verdict.md) has a reservation. Example: `"ECSS"`"""
    target_modes: tuple[Text, ...] = ()
    """Labels of the test modes that must be compared: without one of them a run is not accepted, and other modes that
    were not compared are a reservation. Default: all, of which one in five may be missing. Example: `["1", "2"]`"""
    target_mass: Fraction = 0.05
    """Effective mass, as a fraction of the total mass in a direction, above which a mode of the model below the highest
    test mode must have a partner. Without one a run is not accepted. Example: `0.1`"""
    frequency_error: Fraction | None = None
    """Largest relative frequency error. Example: `0.03`"""
    mac: Fraction | None = None
    """Smallest MAC of a pair. Example: `0.9`"""
    cross_orthogonality: Fraction | None = None
    """Smallest cross-orthogonality of a pair. Example: `0.95`"""
    off_diagonal: Fraction | None = None
    """Largest cross-orthogonality of modes that are not a pair. Example: `0.1`"""
    shape_error: Fraction | None = None
    """Largest relative error of a shape at held-out sensors. Example: `0.1`"""
    frac: Fraction | None = None
    """Smallest FRAC of an unused FRF. Example: `0.9`"""
    fdac: Fraction | None = None
    """Smallest FDAC at equal frequencies, mean over the lines, of an input whose unused FRFs have three outputs or
    more. Example: `0.9`"""
    frf_mean_db: Positive | None = None
    """Largest mean level error of an unused FRF in dB; above 0. Example: `2.0`"""
    frf_max_db: Positive | None = None
    """Largest level error of an unused FRF at any line in dB; above 0. Example: `6.0`"""
    resonance_error: Fraction | None = None
    """Largest relative error of a resonance frequency in the unused FRFs. Example: `0.02`"""
    sweep_frequency: Fraction | None = None
    """Largest relative error of the frequency of the largest response in a sweep ([`[[vibration]]`](#vibration)).
    Example: `0.05`"""
    sweep_amplitude: Fraction | None = None
    """Largest relative error of the amplitude of the largest response in a sweep. Example: `0.05`"""
    random_rms: Fraction | None = None
    """Largest relative error of the root mean square in random vibration. Example: `0.07`"""
    transient_peak: Fraction | None = None
    """Largest relative error of the largest response to a transient. Example: `0.1`"""
    frf_from_hz: HertzAboveZero | None = None
    """Lowest frequency of the lines for criteria on FRFs, Hz. Default: that of the FRF residuals, otherwise of the
    test. Example: `20.0`"""
    frf_to_hz: HertzAboveZero | None = None
    """Highest frequency of the lines for criteria on FRFs, Hz. Default: that of the FRF residuals, otherwise of the
    test. Example: `400.0`"""
    frequency_sd: Fraction | None = None
    """Relative standard deviation of the measured frequencies, to decide whether measurement noise explains a
    deviation. Default: the value given in the test file, otherwise that of the residuals. Example: `0.002`"""
    shape_sd: Fraction | None = None
    """Standard deviation of the measured shapes, as a fraction of the largest entry of each. Default: the value given
    in the test file, otherwise unknown. Example: `0.02`"""

    @property
    def own_limits(self) -> dict[str, float]:
        """User-defined limits by key."""
        limits = {name: getattr(self, name) for name in OWN_LIMITS}
        return {name: value for name, value in limits.items() if value is not None}


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


_HELD_OUT_KEYS = ("modes", "above_hz", "below_hz", "sensors", "outputs", "inputs", "worst")
"""Keys of [[hold_out]] of which at least one is required."""


def validation_rules(data: Data, source: StudyLines) -> Problems:
    """User-defined criteria need limits; held-out data must exist in a configuration of the update."""
    validate = table(data, "validate")
    if validate.get("profile") == "own" and not any(key in validate for key in OWN_LIMITS):
        yield source.error(("validate", "profile"), "study.no-criteria", {})
    low, high = number(validate, "frf_from_hz"), number(validate, "frf_to_hz")
    if low is not None and high is not None and low >= high:
        shown = {"frf_from_hz": low, "frf_to_hz": high}
        yield source.error(("validate", "frf_to_hz"), "study.response-lines/validation", shown)
    configurations = {e["name"]: e for _, e in tables(data, "configuration") if isinstance(e.get("name"), str)}
    for place, entry in tables(data, "hold_out"):
        if not any(entry.get(key) for key in _HELD_OUT_KEYS):
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
