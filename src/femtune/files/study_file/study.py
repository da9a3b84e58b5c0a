"""StudyFile: the checked content of a study file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import Field, PrivateAttr

from femtune.errors import Where
from femtune.files.study_file.bootstrap import BootstrapTable
from femtune.files.study_file.candidates import CandidateEntry, CandidatesTable
from femtune.files.study_file.component import ComponentEntry
from femtune.files.study_file.configuration import ConfigurationEntry, SingleTest, only_configuration
from femtune.files.study_file.correlate import CorrelateTable
from femtune.files.study_file.derived import DerivedEntry
from femtune.files.study_file.distribution import DistributionEntry
from femtune.files.study_file.equalise import EqualiseTable
from femtune.files.study_file.info import ChecksTable
from femtune.files.study_file.intervals import IntervalsTable
from femtune.files.study_file.kinds import SchemaVersion, TomlTable
from femtune.files.study_file.matrices import GenericEntry, MatrixEntry, ModelTable, VariableEntry
from femtune.files.study_file.modes import ModesTable
from femtune.files.study_file.output import StudyOutputTable
from femtune.files.study_file.over_frequency import FrequencyTableEntry
from femtune.files.study_file.parallel import ParallelTable
from femtune.files.study_file.parameter import Parameter
from femtune.files.study_file.plan import PlanTable
from femtune.files.study_file.posterior import PosteriorTable
from femtune.files.study_file.quantify import QuantifyTable
from femtune.files.study_file.report import ReportTable
from femtune.files.study_file.residual import Comparison, ResidualEntry, ResidualsTable
from femtune.files.study_file.respond import LoadEntry, ResponseTable
from femtune.files.study_file.runs import RunsModelTable
from femtune.files.study_file.screen import ScreenTable
from femtune.files.study_file.search import SearchTable
from femtune.files.study_file.select import SelectTable
from femtune.files.study_file.sensors import RigidFloorEntry, SensorEntry, SensorsTable
from femtune.files.study_file.solver import SolverTable
from femtune.files.study_file.source import StudyLines
from femtune.files.study_file.stage import StageEntry
from femtune.files.study_file.study_table import StudyTable
from femtune.files.study_file.update import ReductionTable, UpdateTable
from femtune.files.study_file.validate import HoldOutEntry, ValidateTable
from femtune.files.study_file.vibration import VibrationEntry
from femtune.files.study_file.write import WriteTable

if TYPE_CHECKING:
    from femtune.files.built_model import BuiltModel
    from femtune.testdata import ModalTest


@dataclass(frozen=True, eq=False)
class Given:
    """Python objects that were given to a study instead of files.

    Parameters
    ----------
    model : the deck or the matrices, read
    tests : by the name under which the study has them as files
    matrices : of the model, in the same way; arrays of NumPy or SciPy
    dofs : node and component of each of their rows
    own_model : the model, a function of the user in place of a solver, by the name that stands for its input file
    residuals : further comparisons, of classes that have no key in the study file
    text : text in place of a study file; None if there is a file
    units_known : False for a deck, which does not state its units
    """

    model: BuiltModel | None = None
    tests: Mapping[str, ModalTest] = field(default_factory=dict)
    matrices: Mapping[str, Any] = field(default_factory=dict)
    dofs: tuple[tuple[int, int], ...] = ()
    own_model: Mapping[str, Any] = field(default_factory=dict)
    residuals: tuple[Any, ...] = ()
    text: str | None = None
    units_known: bool = True

    @property
    def names(self) -> set[str]:
        """Names of files in whose place objects were given."""
        return {*self.tests, *self.matrices, *self.own_model}


class StudyFile(TomlTable):
    """A study: the attributes are the tables of the file.

    Files named inside are relative to the study file; `path_of` says where they are.
    """

    schema_version: SchemaVersion = 1
    """Version of the study file, an integer before the first table. A file of a later version is refused. Example:
    `1`"""
    study: StudyTable
    model: ModelTable = Field(default_factory=ModelTable)
    matrix: tuple[MatrixEntry, ...] = ()
    variable: tuple[VariableEntry, ...] = ()
    runs: RunsModelTable | None = None
    solver: SolverTable | None = None
    modes: ModesTable = Field(default_factory=ModesTable)
    test: SingleTest | None = None
    component: tuple[ComponentEntry, ...] = ()
    configuration: tuple[ConfigurationEntry, ...] = ()
    sensors: SensorsTable = Field(default_factory=SensorsTable)
    sensor: tuple[SensorEntry, ...] = ()
    rigid_floor: tuple[RigidFloorEntry, ...] = ()
    correlate: CorrelateTable = Field(default_factory=CorrelateTable)
    generic: tuple[GenericEntry, ...] = ()
    distribution: tuple[DistributionEntry, ...] = ()
    parameter: tuple[Parameter, ...] = ()
    frequency_table: tuple[FrequencyTableEntry, ...] = ()
    derived: tuple[DerivedEntry, ...] = ()
    residuals: ResidualsTable = Field(default_factory=ResidualsTable)
    residual: tuple[ResidualEntry, ...] = ()
    """One comparison in one configuration, of the quantity that `kind` says."""
    equalise: EqualiseTable | None = None
    update: UpdateTable = Field(default_factory=UpdateTable)
    hold_out: tuple[HoldOutEntry, ...] = ()
    validation: ValidateTable = Field(default_factory=ValidateTable, alias="validate")
    vibration: tuple[VibrationEntry, ...] = ()
    checks: ChecksTable = Field(default_factory=ChecksTable)
    reduction: ReductionTable | None = None
    stage: tuple[StageEntry, ...] = ()
    plan: PlanTable | None = None
    intervals: IntervalsTable | None = None
    screen: ScreenTable | None = None
    search: SearchTable | None = None
    candidates: CandidatesTable | None = None
    candidate: tuple[CandidateEntry, ...] = ()
    response: ResponseTable | None = None
    select: SelectTable = Field(default_factory=SelectTable)
    quantify: QuantifyTable | None = None
    bootstrap: BootstrapTable | None = None
    posterior: PosteriorTable | None = None
    parallel: ParallelTable = Field(default_factory=ParallelTable)
    load: tuple[LoadEntry, ...] = ()
    write: WriteTable = Field(default_factory=WriteTable)
    report: ReportTable = Field(default_factory=ReportTable)
    output: StudyOutputTable = Field(default_factory=StudyOutputTable)

    _path: Path = PrivateAttr(default=Path("study.toml"))
    _source: StudyLines = PrivateAttr(default=StudyLines("study.toml"))
    _given: Given = PrivateAttr(default_factory=Given)

    @property
    def path(self) -> Path:
        """The study file itself."""
        return self._path

    @property
    def given(self) -> Given:
        """Objects that the study was given."""
        return self._given

    @property
    def configurations(self) -> tuple[ConfigurationEntry, ...]:
        """All configurations: those of the file, or the only one, with the test of [test]."""
        return self.configuration or (only_configuration(self.test),)

    @property
    def specimens(self) -> tuple[str, ...]:
        """Names of the nominally identical specimens, in the order of their configurations; none without them."""
        return tuple(dict.fromkeys(c.specimen for c in self.configuration if c.specimen is not None))

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        """All residuals: those of [residuals], and every [[residual]]."""
        tables = (Comparison(entry, ("residual", i)) for i, entry in enumerate(self.residual))
        return (*self.residuals.comparisons(alone=not self.residual), *tables)

    @property
    def source(self) -> SolverTable | RunsModelTable | MatrixEntry | StudyTable:
        """The table that defines the model: [solver], [runs], the first [[matrix]], or [study] deck."""
        return self.solver or self.runs or next(iter(self.matrix), self.study)

    @property
    def output_folder(self) -> Path:
        """The run folder."""
        return self.path_of(self.output.folder)

    def path_of(self, name: str) -> Path:
        """A file named in the study: relative to the study file."""
        return self._path.parent / name

    def where(self, *place: str | int) -> Where:
        """File and line of a key: ``where("parameter", 0, "lower")``, positions from 0."""
        return self._source.where(place)
