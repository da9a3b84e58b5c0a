"""Mode shapes for pictures: lines and faces of the active elements, motion of the grid points and of the sensors."""

from __future__ import annotations

from femtune.study.record import ModelVersion, Record


class ModeShapes(Record):
    """Shapes of the solved modes of one configuration at one model version, for drawing (single precision)."""

    configuration: str
    """Name of the configuration."""
    stage: ModelVersion
    """"before", "after" or "after as written"."""
    points_key: str | None = None
    """Key of the coordinates of the points that are drawn, shape (points, 3); None if no shapes were stored."""
    point_numbers_key: str | None = None
    """Key of the numbers of the grid points that are drawn, shape (points,); None in older results."""
    lines_key: str | None = None
    """Key of the lines, shape (lines, 2): rows of the points at both ends."""
    line_kinds_key: str | None = None
    """Key of the kinds of the lines, shape (lines,): 0 for two-node elements, 1 for rigid elements."""
    faces_key: str | None = None
    """Key of shells and the outer faces of solids, shape (faces, 4): rows of the points at their corners, −1 for the
    fourth of a triangle; None in older results without this field."""
    line_elements_key: str | None = None
    """Key of the element number of each line, shape (lines,), 0 for rigid elements; None in older results."""
    face_elements_key: str | None = None
    """Key of the element number of each face, shape (faces,); None in older results."""
    translations_key: str | None = None
    """Key of the motion of the points, shape (points, 3, modes), modes as in ModelModes.freq_hz; complex for complex
    modes."""
    energy_key: str | None = None
    """Key of the strain energy at the points, shape (points, modes): the largest share that an element at the point has
    in the strain energy of the mode, in %, without elements that are lines; 0 for rigid-body modes; None without
    elements that have a stiffness."""
    line_energy_key: str | None = None
    """Key of the shares of the elements that are drawn as a line, shape (lines, modes), in %."""
    sensor_positions_key: str | None = None
    """Key of the positions of the sensors on the model, shape (sensors, 3); NaN where unknown; None without a test."""
    sensor_directions_key: str | None = None
    """Key of the sensors' unit directions, or axes of rotation, shape (sensors, 3)."""
    sensor_rotations_key: str | None = None
    """Key of 1 for sensors that measure a rotation and 0 for others, shape (sensors,)."""
    sensor_nodes_key: str | None = None
    """Key of the numbers of the test's points, shape (sensors,); None in older results and without a test."""
    test_shapes_key: str | None = None
    """Key of the measured shapes, shape (sensors, test modes), modes as in CorrelationResults.mac_test_labels."""
    wire_key: str | None = None
    """Key of the wire frame of the test, shape (wires, 2): rows of a sensor at both ends; None in older results and
    without a test."""
    model_at_sensors_key: str | None = None
    """Key of the model's motion seen by the sensors, shape (sensors, modes)."""
    simplified: str = ""
    """Simplification of a large mesh, in words; "" if it is complete."""
    reason: str = ""
    """The reason why no shapes were stored; "" if they were."""
