"""[[vibration]]: a sine sweep, random vibration or a transient that the updated model is compared with."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, Literal

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.configuration import ConfigurationSolver
from femtune.files.study_file.kinds import (
    Component,
    DofLabel,
    Fraction,
    HertzAboveZero,
    Labels,
    NamesFile,
    Positive,
    Text,
    TomlTable,
)
from femtune.files.study_file.source import Place, StudyLines, falls, named_twice, tables
from femtune.model.kinds import SweepLaw


class VibrationEntry(TomlTable):
    """[[vibration]]: excitation, points, damping, and the file of what was measured."""

    name: Text
    """Name of the test. Example: `"sweep X"`"""
    kind: Literal["sweep", "random", "transient"]
    """`"sweep"`, `"random"` or `"transient"`. Example: `"random"`"""
    configuration: Text | None = None
    """The configuration in this test, such as the structure on the shaker table; required if there are several.
    Example: `"table"`"""
    base: Component | None = None
    """Direction in which all supports move: `"X"`, `"Y"`, `"Z"`, `"RX"`, `"RY"`, `"RZ"`; either this or `input`.
    Example: `"X"`"""
    input: DofLabel | None = None
    """DOF at which a force acts. Example: `"12Z+"`"""
    outputs: Labels
    """DOFs whose acceleration was measured. Example: `["101X+", "205X+"]`"""
    damping_ratio: Fraction | tuple[Fraction, ...] | None = None
    """Damping ratio of all modes, or a list of ratios at `damping_hz`. Default: SDAMPING of the deck. Example:
    `0.02`"""
    damping_hz: tuple[HertzAboveZero, ...] = ()
    """Rising frequencies of a list of damping ratios, Hz; linear between them and constant outside. Example: `[38.1,
    104.0]`"""
    damping_source: Text | None = None
    """Where the damping is from; stated in results and report. Example: `"resonance search of 12 May"`"""
    from_hz: HertzAboveZero | None = None
    """First frequency of a sweep, Hz; required for it. Example: `4.0`"""
    to_hz: HertzAboveZero | None = None
    """Last frequency of a sweep, Hz; required for it. Example: `200.0`"""
    rate: Positive | None = None
    """Rate of a sweep, octaves per minute or Hz/s; required for it. Example: `2.0`"""
    law: SweepLaw = "logarithmic"
    """`"logarithmic"` or `"linear"` sweep. Example: `"linear"`"""
    amplitude: Positive = 1.0
    """Amplitude of a sweep. Example: `0.1`"""
    spectrum_hz: tuple[HertzAboveZero, ...] = ()
    """Frequencies of the power spectral density of random vibration, Hz; required for it. Example: `[10.0, 100.0,
    2000.0]`"""
    spectrum: tuple[Positive, ...] = ()
    """Power spectral density at `spectrum_hz`, in squares of the unit of the responses per Hz, straight in a double
    logarithmic plot; required for random vibration. Example: `[0.01, 0.04, 0.04]`"""
    signal: Annotated[Text, NamesFile("record of the base motion or force")] | None = None
    """CSV file of a transient excitation: heading, then even times in s and the value; required for it. Example:
    `"shock.csv"`"""
    measured: Annotated[Text, NamesFile("table of measured vibration")] | None = None
    """CSV file: heading, then frequency and a value for each output (amplitude, or power spectral density); for a
    transient time in s and values. Example: `"sweep_x.csv"`"""
    band_hz: tuple[HertzAboveZero, HertzAboveZero] | None = None
    """Band over which largest amplitude or root mean square are compared, Hz, such as that of one resonance. Default:
    all that excitation and `measured` have in common. Example: `[20.0, 60.0]`"""
    solver: ConfigurationSolver | None = None
    """For a model of a [solver](#solver): what the model on the table has of its own, as in
    [`[[configuration]]`](#configuration). Default: that of the configuration. Example: `{ templates = ["table.inp"]
    }`"""


_REQUIRED_KEYS = {
    "sweep": ("from_hz", "to_hz", "rate"),
    "random": ("spectrum_hz", "spectrum"),
    "transient": ("signal",),
}
"""Keys that a kind of excitation requires."""
_KEYS_OF_KIND = {**_REQUIRED_KEYS, "sweep": (*_REQUIRED_KEYS["sweep"], "law", "amplitude")}
"""Keys that only one kind has."""


def vibration_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Each kind needs one excitation, and its required keys."""
    entries = list(tables(data, "vibration"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    known = [e["name"] for _, e in tables(data, "configuration") if isinstance(e.get("name"), str)]
    for place, entry in entries:
        if ("base" in entry) == ("input" in entry):
            yield source.error(place, "vibration.entry", {})
        missing = [key for key in _REQUIRED_KEYS.get(str(entry.get("kind")), ()) if key not in entry]
        if missing:
            yield source.error(place, "vibration.entry/missing", {}, kind=entry["kind"], keys=", ".join(missing))
        kind, others = str(entry.get("kind")), {k: kind for kind, keys in _KEYS_OF_KIND.items() for k in keys}
        for key in (k for k in entry if kind in _KEYS_OF_KIND and others.get(k, kind) != kind):
            yield source.error((*place, key), "vibration.entry/other-kind", {}, kind=kind, key=key, other=others[key])
        yield from _damping(place, entry, source)
        if falls(entry.get("band_hz")):
            yield source.error((*place, "band_hz"), "vibration.entry/band", {})
        if "solver" in entry and "solver" not in data:
            yield source.error((*place, "solver"), "vibration.entry/no-solver", {})
        if "solver" in data and "input" in entry:
            yield source.error((*place, "input"), "vibration.entry/solver-input", {})
        name = entry.get("configuration")
        if isinstance(name, str) and name not in known:
            hint = did_you_mean(name, known) or "the study has no [[configuration]]; remove the key"
            yield source.error((*place, "configuration"), "vibration.entry/configuration", {}, hint=hint, name=name)
        if name is None and len(known) > 1 and "solver" not in entry:
            yield source.error(place, "vibration.entry/which-configuration", {})


def _damping(place: Place, entry: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """Several damping ratios need ascending frequencies."""
    ratios, hz = entry.get("damping_ratio"), entry.get("damping_hz", ())
    if not isinstance(hz, tuple):
        return
    if not isinstance(ratios, tuple):
        if hz:
            yield source.error((*place, "damping_hz"), "vibration.entry/no-list", {})
        return
    count = len(ratios)
    if len(hz) != count or not _rises(hz):
        yield source.error((*place, "damping_ratio"), "vibration.entry/damping", {}, ratios=count, lines=len(hz))


def _rises(values: tuple[Any, ...]) -> bool:
    """Values that are not numbers are reported elsewhere."""
    numbers = [v for v in values if isinstance(v, int | float)]
    return all(a < b for a, b in pairwise(numbers))
