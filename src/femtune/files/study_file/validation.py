"""[validate], [[hold_out]] and [checks]: what is kept from the update, and by which numbers it is judged."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.study_file.kinds import DofLabel, Positive, Text
from femtune.files.study_file.table import Table

Fraction = Annotated[float, Field(gt=0, lt=1)]


class HoldOutEntry(Table):
    """[[hold_out]]: modes and sensors of a configuration's test that the update does not see."""

    configuration: Text | None = None
    modes: tuple[Text, ...] = ()
    above_hz: Positive | None = None
    below_hz: Positive | None = None
    sensors: tuple[DofLabel, ...] = ()


class ValidateTable(Table):
    """[validate]: criteria of a standard or own ones, and the scatter of the tests that they judge."""

    profile: Literal["all", "NASA", "MIL", "ECSS", "own"] = "all"
    frequency_error: Fraction | None = None
    mac: Fraction | None = None
    cross_orthogonality: Fraction | None = None
    off_diagonal: Fraction | None = None
    shape_error: Fraction | None = None
    frequency_sd: Fraction | None = None
    shape_sd: Fraction | None = None

    @property
    def own_limits(self) -> dict[str, float]:
        """Own numbers by key."""
        found = {name: getattr(self, name) for name in OWN_LIMITS}
        return {name: value for name, value in found.items() if value is not None}


class ChecksTable(Table):
    """[checks]: what is asked of the model before it is updated."""

    refinement: bool = False
    mesh_error: Fraction = 0.02
    mass_error: Fraction = 0.02


OWN_LIMITS = ("frequency_error", "mac", "cross_orthogonality", "off_diagonal", "shape_error")
"""Keys of [validate] that are limits of criteria."""
