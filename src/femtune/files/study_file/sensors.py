"""[sensors], [[sensor]] and [[rigid_floor]]: how the degrees of freedom of a test correspond to those of the model."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from femtune.dofs import DIRECTIONS, Dof, parse_dof
from femtune.files.study_file.kinds import ByNode, Component, DofLabel, Number, Positive, TomlTable, Vector, numbered


class SensorsTable(TomlTable):
    """[sensors]: assignment of test nodes to grid points of the model."""

    tolerance: Positive | None = None
    """Largest distance between a test node and its grid point, length, positive. Default: a thousandth of the diagonal
    of the model. Example: `0.05`"""
    by_id: bool = False
    """Assign a test node to the grid point with the same number. Example: `true`"""
    nodes: Annotated[dict[Number, Number], BeforeValidator(numbered)] = Field(default_factory=dict)
    """Prescribed assignment of test nodes to grid points. Example: `{ "101" = 12 }`"""
    leave_out: tuple[Number, ...] = ()
    """Test nodes that are not compared, because the model has no grid point near them. Example: `[12, 31]`"""
    position_sd: ByNode = 0.0
    """Standard deviation of each coordinate of the position of a sensor, length: a number for all test nodes, or by
    test node (0 for the others). It is [propagated](theory/correlation.md#errors-of-sensor-placement) to the covariance
    of shape differences. Example: `{ 11 = 0.005, 12 = 0.01 }`"""
    angle_sd_deg: ByNode = 0.0
    """Standard deviation of the rotation of a sensor about each axis, degrees: a number for all test nodes, or by test
    node (0 for the others). It is propagated likewise. Example: `2.0`"""


class SensorTerm(TomlTable):
    """One model DOF in a generalised sensor."""

    node: Number
    """Grid point or scalar point. Example: `3`"""
    component: Literal["S", Component]
    """X Y Z RX RY RZ in the displacement coordinate system of the grid point, S for a scalar point. Example: `"X"`"""
    factor: float = 1.0
    """Factor on its displacement. Example: `0.5`"""


class SensorEntry(TomlTable):
    """[[sensor]]: a sensor that is a combination of model DOFs."""

    name: DofLabel
    """Label of the degree of freedom in the test. Example: `"11X+"`"""
    terms: Annotated[tuple[SensorTerm, ...], Field(min_length=1)]
    """Terms of the linear combination: model DOFs with their factors. Example: `[{ node = 3, component = "X", factor =
    0.5 }]`"""

    @property
    def label(self) -> Dof:
        """The DOF of the test that it stands for."""
        return parse_dof(self.name)


class RigidFloorEntry(TomlTable):
    """[[rigid_floor]]: least-squares rigid motion of a floor's nodes, as sensors of one test node."""

    test_node: Number
    """Test node of the rigid-body motion. Example: `1`"""
    nodes: Annotated[tuple[Number, ...], Field(min_length=1)]
    """Grid points of the floor. Example: `[11, 12, 13, 14]`"""
    origin: Vector
    """Reference point of the motion, basic coordinate system, length. Example: `[0, 0, 2]`"""
    components: Annotated[tuple[Component, ...], Field(min_length=1)] = ("X", "Y", "RZ")
    """Components of the motion, basic coordinate system. Example: `["X", "Y"]`"""

    @property
    def digits(self) -> str:
        """The components as Nastran writes them: "126"."""
        return "".join(str(DIRECTIONS.index(component)) for component in self.components)
