"""Updated values beside the range that is usual for their kind of property."""

from __future__ import annotations

from femtune.study.record import Record


class UnusualValue(Record):
    """A parameter beyond the usual range of the fields that it sets."""

    parameter: str
    """Name of the parameter."""
    what: str
    """Kind of the property: "material: stiffness"."""
    factor: float
    """Updated over initial value (no unit)."""
    lower: float
    """Lower end of the usual range of this factor."""
    upper: float
    """Upper end."""


class UsualRanges(Record):
    """Parameters that the update moved beyond the usual range."""

    beyond: tuple[UnusualValue, ...]
    """Those beyond it."""
