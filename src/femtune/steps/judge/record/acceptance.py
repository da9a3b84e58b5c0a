"""What the study asks of an accepted model, as far as the verdict needs it."""

from __future__ import annotations

from femtune.study.record import Record


class AcceptanceResults(Record):
    """The acceptance criteria that the study chooses, and its target modes."""

    chosen: bool
    """True if the study names one standard, or limits of its own; False if the limits of all standards are shown."""
    standard: str
    """The criteria in words: "NASA-STD-5002", "own", "all standards"."""
    target_modes: tuple[str, ...]
    """Labels of the test modes that must be compared; empty if the study names none."""
    target_mass_percent: float
    """Effective mass above which a model mode must have a partner in the test, in % of the total mass."""
    left_out_percent: float
    """Share of the test modes that may be left uncompared, in %."""
