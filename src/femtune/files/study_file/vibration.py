"""[[vibration]]: a sine sweep or a random vibration test that the updated model is compared with."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field

from femtune.errors import FemtuneError, did_you_mean
from femtune.files.study_file.kinds import DofLabel, Positive, Text, TomlTable
from femtune.files.study_file.response import HertzAboveZero, Labels
from femtune.files.study_file.source import StudyLines, named_twice, tables

Fraction = Annotated[float, Field(gt=0, lt=1)]


class VibrationEntry(TomlTable):
    """[[vibration]]: excitation, points, damping, and the file of what was measured."""

    name: Text
    kind: Literal["sweep", "random"]
    configuration: Text | None = None
    base: Literal["X", "Y", "Z", "RX", "RY", "RZ"] | None = None
    input: DofLabel | None = None
    outputs: Labels
    damping_ratio: Fraction | None = None
    from_hz: HertzAboveZero | None = None
    to_hz: HertzAboveZero | None = None
    rate: Positive | None = None
    law: Literal["logarithmic", "linear"] = "logarithmic"
    amplitude: Positive = 1.0
    spectrum_hz: tuple[HertzAboveZero, ...] = ()
    spectrum: tuple[Positive, ...] = ()
    measured: Text | None = None


def vibration_rules(data: dict[str, Any], source: StudyLines) -> Iterator[FemtuneError]:
    """One excitation, and all that its kind needs."""
    entries = list(tables(data, "vibration"))
    yield from named_twice(entries, "study.duplicate-name/earlier", source)
    known = [e["name"] for _, e in tables(data, "configuration") if isinstance(e.get("name"), str)]
    for place, entry in entries:
        if ("base" in entry) == ("input" in entry):
            yield source.error(place, "vibration.entry", {})
        needed = ("from_hz", "to_hz", "rate") if entry.get("kind") == "sweep" else ("spectrum_hz", "spectrum")
        missing = [key for key in needed if key not in entry]
        if missing and entry.get("kind") in ("sweep", "random"):
            yield source.error(place, "vibration.entry/missing", {}, kind=entry["kind"], keys=", ".join(missing))
        name = entry.get("configuration")
        if isinstance(name, str) and name not in known:
            hint = did_you_mean(name, known) or "the study has no [[configuration]]; remove the key"
            yield source.error((*place, "configuration"), "vibration.entry/configuration", {}, hint=hint, name=name)
        if name is None and len(known) > 1:
            yield source.error(place, "vibration.entry/which-configuration", {})
