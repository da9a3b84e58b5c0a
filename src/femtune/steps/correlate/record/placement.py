"""Effect of errors in the positions and directions of the sensors on the test shapes, as records."""

from __future__ import annotations

from femtune.study.record import Record


class PlacementOfMode(Record):
    """One paired test mode."""

    test_label: str
    """Label of the test mode."""
    sd_percent: float
    """Root mean square over the sensors of the standard deviation that the placement adds to an entry, relative to the
    largest entry of the shape, in %."""
    largest_percent: float
    """The largest of these standard deviations, in %."""
    largest_dof: str
    """Its sensor."""
    mac_loss: float
    """Mean of 1 − MAC that errors of the placement alone give."""


class PlacementResults(Record):
    """Effect of the errors in the placement of the sensors that the study states."""

    position_sd: tuple[float, float]
    """Smallest and largest standard deviation of a coordinate of a sensor's position, in the study's unit of length."""
    angle_sd_deg: tuple[float, float]
    """Smallest and largest standard deviation of a sensor's direction about an axis, in degrees."""
    modes: tuple[PlacementOfMode, ...]
    """Paired modes."""
