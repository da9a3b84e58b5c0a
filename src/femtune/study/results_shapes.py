"""Records about mode shapes as pictures: the model's lines and faces, its motion, and the measured one."""

from __future__ import annotations

from femtune.study.results_base import Record, Stage


class ModeShapes(Record):
    """Shapes of the solved modes of one configuration at one stage, in basic axes, for drawing (single precision)."""

    configuration: str
    """Name of the configuration."""
    stage: Stage
    """"before", "after" or "after as written"."""
    points_key: str | None = None
    """Key of the coordinates of the points that are drawn, shape (points, 3); None where no shapes were kept."""
    lines_key: str | None = None
    """Key of the lines, shape (lines, 2): rows of the points at both ends."""
    line_kinds_key: str | None = None
    """Key of the kinds of the lines, shape (lines,): 0 for two-node elements, 1 for rigid elements."""
    faces_key: str | None = None
    """Key of shells and the outer faces of solids, shape (faces, 4): rows of the points at their corners, −1 for the
    fourth of a triangle; None in results of before shells were drawn."""
    translations_key: str | None = None
    """Key of the motion of the points, shape (points, 3, modes), modes as in ModelModes.freq_hz."""
    sensor_positions_key: str | None = None
    """Key of the places of the sensors on the model, shape (sensors, 3); NaN where unknown; None without a test."""
    sensor_directions_key: str | None = None
    """Key of the sensors' unit directions, or axes of rotation, shape (sensors, 3)."""
    sensor_rotations_key: str | None = None
    """Key of 1 for sensors that measure a rotation and 0 for others, shape (sensors,)."""
    test_shapes_key: str | None = None
    """Key of the measured shapes, shape (sensors, test modes), modes as in CorrelationResults.mac_test_labels."""
    model_at_sensors_key: str | None = None
    """Key of the model's motion seen by the sensors, shape (sensors, modes)."""
    simplified: str = ""
    """What lines and faces leave out of a large mesh, in words; "" where they are all there."""
    reason: str = ""
    """Why no shapes were kept; "" where they were."""
