"""Test shapes expanded to the model, as records."""

from __future__ import annotations

from femtune.study.record import Record


class ExpansionError(Record):
    """Error of one method at sensors that were left out."""

    method: str
    """"serep", "dynamic" or "mdre"."""
    error_percent: float | None
    """√(Σ(predicted − measured)²/Σ measured²) over all entries, each predicted from the other groups of sensors, in %;
    None if the other sensors do not determine the shape."""


class ExpandedMode(Record):
    """One test mode that was expanded."""

    test_label: str
    """Label of the test mode."""
    test_freq_hz: float
    """Frequency of the test in Hz."""
    misfit_percent: float | None
    """Difference of the expanded and the measured shape at the sensors, relative to the measured shape, in %; None if
    the shape could not be expanded."""
    errors: tuple[ExpansionError, ...]
    """Error of each method at sensors that were left out."""


class ExpansionResults(Record):
    """Test shapes of one configuration expanded to all grid points of the model."""

    method: str
    """"serep", "dynamic" or "mdre"."""
    modes: tuple[ExpandedMode, ...]
    """Test modes, without those that the study leaves out."""
    groups: int
    """Number of groups of sensors that were left out in turn; 0 if there is only one sensor."""
    serep_modes: tuple[int, ...]
    """Numbers of the model modes of SEREP, from 1."""
    nodes_key: str
    """Key of the numbers of the grid points, shape (grid points,)."""
    positions_key: str
    """Key of their coordinates in the basic system, shape (grid points, 3)."""
    shapes_key: str
    """Key of the expanded shapes, shape (grid points, 6, modes): translations and rotations in the basic system, in the
    scale of the test; NaN for a mode that could not be expanded."""
    drawn_key: str | None = None
    """Key of the rows of `shapes` that are drawn, in the order of the points of ModeShapes, shape (points,); None if no
    shapes are drawn."""
