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
    largest_order: Annotated[int, Field(ge=4, le=200)] | None = None
    """Largest model order of the identification; 4 to 200. Default: 60, and up to 120 where there are more modes than
    can be told from orders up to 60. Example: `80`"""
    order: Annotated[int, Field(ge=2, le=200, multiple_of=2)] | None = None
    """Fixed order of N4SID: all its poles in the band are modes, whatever other orders have. Default: modes are the
    poles that come back in models up to `largest_order`. Example: `38`"""
    exponential_s: Positive | None = None
    """Time constant τ of an exponential window e^(−t/τ) with which the FRFs were made, s. The poles are those without
    it; measured FRFs are compared with those of the model at iω + 1/τ. Default: that of the identification file of the
    test, if it has one; if both have one, they must agree. Example: `0.5`"""
    suspension_hz: Positive | None = None
    """Modes below this frequency are rigid-body motions on a suspension, Hz: they are fitted with the others, keep
    their damping, and are no modes of the structure; lines below are not compared. Example: `4.0`"""
    rigid_body: bool = False
    """The rigid-body motion of the model, of a free structure at the initial values, is subtracted from the FRFs before
    the identification, and added to the identified system. Example: `true`"""
    take_hz: tuple[Positive, ...] = ()
    """Frequencies of candidates that are modes, Hz. Example: `[57.3]`"""
    drop_hz: tuple[Positive, ...] = ()
    """Frequencies of candidates that are not modes, Hz. Example: `[50.0]`"""
    then: Literal["raw", "nothing"] = "raw"
    """What follows the update with equal damping: `"raw"`: a further update from its result with the measured FRFs
    themselves, the modes of the model having the measured damping; `"nothing"`. Example: `"nothing"`"""

    @property
    def not_compared_hz(self) -> tuple[tuple[float, float], ...]:
        """Bands that are not compared, that of the motions on a suspension among them."""
        on_suspension = () if self.suspension_hz is None else ((0.0, self.suspension_hz),)
        return (*on_suspension, *self.leave_out_hz)


def _is_above(suspension: object, band: object) -> bool:
    """Whether a band ends below the frequency of the suspension; values of the wrong type are left to the types."""
    if not isinstance(band, tuple | list) or len(band) != 2:
        return False
    return isinstance(suspension, int | float) and isinstance(band[1], int | float) and suspension >= band[1]


def equalise_rules(data: Data, source: StudyLines) -> Problems:
    """Bands of [equalise] must have a lower and an upper end, and lines above the suspension."""
    equalise = table(data, "equalise")
    band, suspension = equalise.get("band_hz"), equalise.get("suspension_hz")
    if _is_above(suspension, band):
        shown = {"suspension_hz": suspension, "band_hz": band}
        yield source.error(("equalise", "suspension_hz"), "study.value/suspension", shown)
    if falls(equalise.get("band_hz")):
        shown = {"band_hz": equalise["band_hz"]}
        yield source.error(("equalise", "band_hz"), "study.value/empty-band", shown)
    left_out = equalise.get("leave_out_hz")
    for k, band in enumerate(left_out if isinstance(left_out, tuple | list) else ()):
        if falls(band):
            place: Place = ("equalise", "leave_out_hz", k)
            yield source.error(place, "study.value/empty-band", {"leave_out_hz": band})
