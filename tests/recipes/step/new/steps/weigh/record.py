"""Results of weigh."""

from __future__ import annotations

from femtune.study.record import Record, Vector3


class MassOfConfiguration(Record):
    """Mass properties of one configuration, in the units of the study."""

    configuration: str
    """Name of the configuration."""
    mass: float
    """Mean of the masses in the three directions."""
    centre: Vector3
    """Centre of gravity in the basic frame."""
    moments: Vector3
    """Moments of inertia about axes through the point of reference, parallel to those of the basic frame."""


class WeighResults(Record):
    """Mass properties of all configurations."""

    about: Vector3
    """Point of reference of the moments of inertia."""
    budget: float | None = None
    """Largest permitted mass; None if none is stated."""
    within: bool
    """False if the mass of a configuration exceeds the budget."""
    configurations: tuple[MassOfConfiguration, ...]
    """Each configuration; none if the model has no structure."""
