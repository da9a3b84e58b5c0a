"""Tables of a study file with the options of the steps; docs/study-file.md explains every key."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field

from femtune.correlation.kinds import ExpansionMethod
from femtune.dofs import DIRECTIONS, Dof, parse_dof
from femtune.files.study_file.kinds import (
    ByNode,
    DeckName,
    DofLabel,
    NotNegative,
    Number,
    Positive,
    Text,
    TomlTable,
    Units,
    Vector,
    Weight,
    numbered,
)
from femtune.identification.kinds import Drawing
from femtune.uncertainty.kinds import Jacobian
from femtune.units import UnitSystem, unit_system
from femtune.updating.kinds import RegularisationMethod, SearchMethod, WeightTarget

Component = Literal["X", "Y", "Z", "RX", "RY", "RZ"]


class StudyTable(TomlTable):
    """[study]: title, deck and units."""

    only_configuration: ClassVar[str] = "as the deck"
    """Name of the configuration of a study without [[configuration]]."""

    title: Text
    deck: DeckName | None = None
    units: Units
    allow_ignored: tuple[Text, ...] = ()
    journal: bool = True
    journal_gib: Annotated[float, Field(gt=0, le=1e6)] = 10.0

    @property
    def unit_system(self) -> UnitSystem:
        """The units of the deck and of all values in the study."""
        return unit_system(self.units)


class ModesTable(TomlTable):
    """[modes]: number of modes, or highest frequency."""

    count: Annotated[int, Field(ge=1, le=100_000)] | None = None
    max_hz: Annotated[float, Field(gt=0, le=1e12)] | None = None


class SensorsTable(TomlTable):
    """[sensors]: assignment of test nodes to grid points of the model."""

    tolerance: Positive | None = None
    by_id: bool = False
    nodes: Annotated[dict[Number, Number], BeforeValidator(numbered)] = Field(default_factory=dict)
    position_sd: Annotated[ByNode, BeforeValidator(numbered)] = 0.0
    angle_sd_deg: Annotated[ByNode, BeforeValidator(numbered)] = 0.0


class SensorTerm(TomlTable):
    """One model DOF in a generalised sensor."""

    node: Number
    component: Literal["S", Component]
    factor: float = 1.0


class SensorEntry(TomlTable):
    """[[sensor]]: a sensor that is a combination of model DOFs."""

    name: DofLabel
    terms: Annotated[tuple[SensorTerm, ...], Field(min_length=1)]

    @property
    def label(self) -> Dof:
        """The DOF of the test that it stands for."""
        return parse_dof(self.name)


class RigidFloorEntry(TomlTable):
    """[[rigid_floor]]: least-squares rigid motion of a floor's nodes, as sensors of one test node."""

    test_node: Number
    nodes: Annotated[tuple[Number, ...], Field(min_length=1)]
    origin: Vector
    components: Annotated[tuple[Component, ...], Field(min_length=1)] = ("X", "Y", "RZ")

    @property
    def digits(self) -> str:
        """The components as Nastran writes them: "126"."""
        return "".join(str(DIRECTIONS.index(component)) for component in self.components)


class CorrelateTable(TomlTable):
    """[correlate]: criteria for mode pairing and for close modes, and the expansion of test shapes to the model."""

    frequency_gate: Annotated[float, Field(gt=0, le=1)] = 0.30
    mac_gate: Annotated[float, Field(ge=0, le=1)] = 0.50
    cluster_gap: NotNegative = 0.01
    expand: Literal["none", ExpansionMethod] = "none"
    expand_modes: Annotated[int, Field(ge=1, le=100_000)] | None = None
    expand_noise: Annotated[float, Field(gt=0, lt=1)] = 0.01


class CorrelationEntry(TomlTable):
    """An entry of [update] correlations: a prior correlation of two parameters."""

    one: Text
    other: Text
    value: Annotated[float, Field(gt=-1, lt=1)]


class UpdateTable(TomlTable):
    """[update]: search, convergence and regularisation."""

    max_iterations: Annotated[int, Field(ge=1, le=1_000_000)] = 250
    regularisation: RegularisationMethod = "none"
    weight: Weight = 0.0
    weight_on: WeightTarget = "whole-change"
    adapt: bool = False
    smallest_change: Annotated[float, Field(ge=0, le=1000)] = 0.25
    identical: tuple[Annotated[tuple[Text, ...], Field(min_length=2)], ...] = ()
    correlations: tuple[CorrelationEntry, ...] = ()
    tolerance: Annotated[float, Field(gt=0, lt=1)] = 1e-8
    search: SearchMethod = "levenberg-marquardt"
    starts: Annotated[int, Field(ge=1, le=100_000)] = 1
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    hops: Annotated[int, Field(ge=0, le=1000)] = 0
    samples: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    first: Literal["none", "equation-error"] = "none"


class ReductionTable(TomlTable):
    """[reduction]: the update searches on reduced models and is certified on the full one."""

    tolerance: Annotated[float, Field(gt=0, lt=0.1)] = 1e-4
    full_solutions: Annotated[int, Field(ge=4, le=10_000)] = 20
    order: Annotated[int, Field(ge=10, le=20_000)] = 600
    frf_tolerance: Annotated[float, Field(gt=0, lt=10)] = 0.01


class BootstrapTable(TomlTable):
    """[bootstrap]: spread of the parameters from the FRFs of one test, by drawing frequency lines again."""

    method: Drawing = "lines"
    runs: Annotated[int, Field(ge=10, le=1_000_000)] = 1000
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    jacobian: Jacobian = "shared"
    tolerance: Annotated[float, Field(gt=0, le=1)] = 0.01
    checked: Annotated[int, Field(ge=0, le=1000)] = 5


class ParallelTable(TomlTable):
    """[parallel]: where runs that do not depend on each other are made: starts, bootstrap runs."""

    how: Literal["auto", "processes", "serial", "cluster"] = "auto"
    workers: Annotated[int, Field(ge=0, le=1024)] = 0
    address: Text = "tcp://127.0.0.1:8786"
    remote: bool = False


Hertz = Annotated[float, Field(ge=0, le=1e12)]


class EqualiseTable(TomlTable):
    """[equalise]: measured FRFs as those of the identified system with one damping ratio; the model's likewise."""

    damping: Annotated[float, Field(gt=0, lt=0.5)]
    band_hz: tuple[Hertz, Hertz] | None = None
    leave_out_hz: tuple[tuple[Hertz, Hertz], ...] = ()
    lines: Annotated[float, Field(gt=0, le=100)] = 3.0
    largest_order: Annotated[int, Field(ge=4, le=200)] = 60
    take_hz: tuple[Positive, ...] = ()
    drop_hz: tuple[Positive, ...] = ()


class WriteTable(TomlTable):
    """[write]: options for writing the updated deck."""

    wide: bool = False
    split: bool = False


class OutputTable(TomlTable):
    """[output]: the run folder; a relative path refers to the folder of the study file."""

    folder: Text = "run"


class StudyOutputTable(OutputTable):
    """[output] of a study: the run folder, and what is written beside the report."""

    vtu: bool = False
