"""[[residual]]: one comparison in one configuration; the key `kind` says which, docs/study-file.md the other keys.

A further kind is a table here, its name in `ResidualEntry`, and a builder in `femtune.study.residual_builders`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from femtune.files.study_file.kinds import Covariance, DofLabel, FrequencySd, NotNegative, Positive, Text, Vector
from femtune.files.study_file.residual_frf import AntiresonanceResidualEntry, FrfResidualEntry
from femtune.files.study_file.table import Table

Labels = Annotated[tuple[Text, ...], Field(min_length=1)]
Sensors = Annotated[tuple[DofLabel, ...], Field(min_length=1)]
Scale = Literal["unit-norm", "largest-entry", "scale-factor", "mass"]
Displacements = Annotated[dict[DofLabel, float], Field(min_length=1)]


class ResidualTable(Table):
    """What all kinds have: the configuration, which a study of several must name."""

    configuration: Text | None = None


class OfModesTable(ResidualTable):
    """Of modes: all of the test that are not left out, or those of some labels."""

    modes: Labels | None = None


class FrequencyResidualEntry(OfModesTable):
    """Frequencies, relative, or eigenvalues; `covariance` is in Hz², of all modes of the test."""

    kind: Literal["frequency"]
    form: Literal["frequency", "eigenvalue"] = "frequency"
    sd: FrequencySd | None = None
    covariance: Covariance | None = None


class ShapeResidualEntry(OfModesTable):
    """Shapes, scaled; `covariance` is of the entries of a scaled shape, in the order of `sensors`."""

    kind: Literal["shape"]
    scaling: Scale = "unit-norm"
    sensors: Sensors | None = None
    sd: NotNegative | None = None
    covariance: Covariance | None = None
    mass_scaled: bool = False


class StrainResidualEntry(OfModesTable):
    """Strain shapes: those sensors of the test that are strain gauges, combinations of [[sensor]] in the model."""

    kind: Literal["strain"]
    scaling: Scale = "unit-norm"
    sensors: Sensors
    sd: NotNegative | None = None
    covariance: Covariance | None = None
    mass_scaled: bool = False


class MacResidualEntry(OfModesTable):
    """A function of the MAC."""

    kind: Literal["mac"]
    form: Literal["root", "ratio", "difference"] = "root"
    sd: NotNegative


class FlexibilityResidualEntry(OfModesTable):
    """Modal flexibility at the sensors, relative to its largest entry."""

    kind: Literal["flexibility"]
    part: Literal["matrix", "diagonal"] = "matrix"
    sd: NotNegative
    mass_scaled: bool = False


class DynamicResidualEntry(OfModesTable):
    """Equation error of the measured modes; `sd` is of a force where the largest entry of the shape is one."""

    kind: Literal["dynamic"]
    sd: NotNegative


class DisplacementResidualEntry(ResidualTable):
    """Static displacements; `sd` is relative to the largest one, `covariance` in their unit, in their order."""

    kind: Literal["static-displacement"]
    name: Text
    forces: Displacements
    displacements: Displacements
    sd: NotNegative | None = None
    covariance: Covariance | None = None


class ForceResidualEntry(ResidualTable):
    """Forces that measured displacements need in the model; `sd` is of a force."""

    kind: Literal["static-force"]
    name: Text
    forces: Displacements
    displacements: Displacements
    sd: NotNegative


class MassResidualEntry(ResidualTable):
    """Weighed mass; `sd` is relative."""

    kind: Literal["mass"]
    mass: Positive
    sd: NotNegative


class CentreResidualEntry(ResidualTable):
    """Centre of gravity, basic frame; `sd` is a length."""

    kind: Literal["centre-of-gravity"]
    x: float | None = None
    y: float | None = None
    z: float | None = None
    sd: NotNegative


class InertiaResidualEntry(ResidualTable):
    """Entries of the inertia tensor about a point, basic frame; `sd` is relative to the largest one."""

    kind: Literal["inertia"]
    ixx: float | None = None
    iyy: float | None = None
    izz: float | None = None
    ixy: float | None = None
    ixz: float | None = None
    iyz: float | None = None
    about: Vector = (0.0, 0.0, 0.0)
    sd: NotNegative


ResidualEntry = Annotated[
    FrequencyResidualEntry
    | ShapeResidualEntry
    | StrainResidualEntry
    | MacResidualEntry
    | FlexibilityResidualEntry
    | DynamicResidualEntry
    | DisplacementResidualEntry
    | ForceResidualEntry
    | MassResidualEntry
    | CentreResidualEntry
    | InertiaResidualEntry
    | FrfResidualEntry
    | AntiresonanceResidualEntry,
    Field(discriminator="kind"),
]
"""Any kind of residual."""
