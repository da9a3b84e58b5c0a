"""[equalise]: measured FRFs with one damping ratio."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.study_file.kinds import Hertz, Positive, TomlTable
from femtune.files.study_file.source import Data, Place, Problems, StudyLines, falls, table


class EqualiseTable(TomlTable):
    """[equalise]: measured FRFs as those of the identified system with one damping ratio; the model's likewise."""

    damping: Annotated[float, Field(gt=0, lt=0.5)]
    """Damping ratio of test and model; above 0, below 0.5. Example: `0.01`"""
    band_hz: tuple[Hertz, Hertz] | None = None
    """Band of the identification and of the lines, Hz. Default: all measured lines. Example: `[40.0, 400.0]`"""
    leave_out_hz: tuple[tuple[Hertz, Hertz], ...] = ()
    """Bands that are not compared, whose poles keep their damping, Hz. Example: `[[118.0, 131.0]]`"""
    lines: Annotated[float, Field(gt=0, le=100)] = 3.0
    """Lines in a half bandwidth 2ζf. Example: `2.0`"""
    largest_order: Annotated[int, Field(ge=4, le=200)] = 60
    """Largest model order of the identification; 4 to 200. Example: `80`"""
    take_hz: tuple[Positive, ...] = ()
    """Frequencies of candidates that are modes, Hz. Example: `[57.3]`"""
    drop_hz: tuple[Positive, ...] = ()
    """Frequencies of candidates that are not modes, Hz. Example: `[50.0]`"""
    then: Literal["raw", "nothing"] = "raw"
    """What follows the update with equal damping: `"raw"`: a further update from its result with the measured FRFs
    themselves, the modes of the model having the measured damping; `"nothing"`. Example: `"nothing"`"""


def equalise_rules(data: Data, source: StudyLines) -> Problems:
    """Bands of [equalise] must have a lower and an upper end."""
    equalise = table(data, "equalise")
    if falls(equalise.get("band_hz")):
        shown = {"band_hz": equalise["band_hz"]}
        yield source.error(("equalise", "band_hz"), "study.value/empty-band", shown)
    left_out = equalise.get("leave_out_hz")
    for k, band in enumerate(left_out if isinstance(left_out, tuple | list) else ()):
        if falls(band):
            place: Place = ("equalise", "leave_out_hz", k)
            yield source.error(place, "study.value/empty-band", {"leave_out_hz": band})
