"""Frequency response functions of the model at each iteration of an update, as records."""

from __future__ import annotations

from femtune.modal.kinds import FrfKind
from femtune.study.record import Record


class IterationFrfs(Record):
    """Compared FRFs of one configuration at each iteration, at the lines that are compared."""

    configuration: str
    """Name of the configuration."""
    kind: FrfKind
    """Motion over force: displacement, velocity or acceleration."""
    phase: bool
    """False if magnitudes alone are compared: the values are magnitudes then."""
    outputs: tuple[str, ...]
    """DOFs of the second axis of the values."""
    inputs: tuple[str, ...]
    """DOFs of the third axis."""
    freq_key: str
    """Key of the frequency lines, shape (lines,), Hz."""
    values_key: str
    """Key of the values of the model, complex, shape (iterations, outputs, inputs, lines), iterations as in the
    history; NaN where nothing is compared."""
    test_values_key: str
    """Key of the values that they are compared with, shape (outputs, inputs, lines): measured or equalised ones."""
    identified_freq_key: str | None = None
    """Key of the measured lines around the identified modes of the test; None if it has no modes with damping, and
    with [equalise], where `MappedDamping` has the identified test."""
    identified_values_key: str | None = None
    """Key of the FRFs of these modes, shape (outputs, inputs, these lines); residues fitted to the measured values."""
    unit: str = ""
    """Unit of translations over forces; empty where the units are not known, and in older results."""
