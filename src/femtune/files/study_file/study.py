"""StudyFile: the whole of a study file, checked."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, PrivateAttr

from femtune.errors import Where
from femtune.files.study_file.configuration import ConfigurationEntry, SingleTest, only_configuration
from femtune.files.study_file.derived import DerivedEntry
from femtune.files.study_file.generic import GenericEntry
from femtune.files.study_file.matrices import MatrixEntry, ModelTable, VariableEntry
from femtune.files.study_file.parameter import ParameterEntry
from femtune.files.study_file.quantify import QuantifyTable, SelectTable
from femtune.files.study_file.residual import ResidualEntry
from femtune.files.study_file.response import LoadEntry, ResponseTable
from femtune.files.study_file.source import Source
from femtune.files.study_file.stage import StageEntry
from femtune.files.study_file.steps import (
    CorrelateTable,
    ModesTable,
    OutputTable,
    ReductionTable,
    ResidualsTable,
    RigidFloorEntry,
    SensorEntry,
    SensorsTable,
    StudyTable,
    UpdateTable,
    WriteTable,
)
from femtune.files.study_file.table import Table
from femtune.files.study_file.validation import ChecksTable, HoldOutEntry, ValidateTable


class StudyFile(Table):
    """A study: attributes are the tables of the file, in its words.

    Files named inside are relative to the study file; `path_of` says where they are.
    """

    study: StudyTable
    model: ModelTable = Field(default_factory=ModelTable)
    matrix: tuple[MatrixEntry, ...] = ()
    variable: tuple[VariableEntry, ...] = ()
    modes: ModesTable = Field(default_factory=ModesTable)
    test: SingleTest | None = None
    configuration: tuple[ConfigurationEntry, ...] = ()
    sensors: SensorsTable = Field(default_factory=SensorsTable)
    sensor: tuple[SensorEntry, ...] = ()
    rigid_floor: tuple[RigidFloorEntry, ...] = ()
    correlate: CorrelateTable = Field(default_factory=CorrelateTable)
    generic: tuple[GenericEntry, ...] = ()
    parameter: tuple[ParameterEntry, ...] = ()
    derived: tuple[DerivedEntry, ...] = ()
    residuals: ResidualsTable = Field(default_factory=ResidualsTable)
    residual: tuple[ResidualEntry, ...] = ()
    update: UpdateTable = Field(default_factory=UpdateTable)
    hold_out: tuple[HoldOutEntry, ...] = ()
    validation: ValidateTable = Field(default_factory=ValidateTable, alias="validate")
    checks: ChecksTable = Field(default_factory=ChecksTable)
    reduction: ReductionTable | None = None
    stage: tuple[StageEntry, ...] = ()
    response: ResponseTable | None = None
    select: SelectTable = Field(default_factory=SelectTable)
    quantify: QuantifyTable | None = None
    load: tuple[LoadEntry, ...] = ()
    write: WriteTable = Field(default_factory=WriteTable)
    output: OutputTable = Field(default_factory=OutputTable)

    _path: Path = PrivateAttr(default=Path("study.toml"))
    _source: Source = PrivateAttr(default=Source("study.toml"))

    @property
    def path(self) -> Path:
        """The study file itself."""
        return self._path

    @property
    def configurations(self) -> tuple[ConfigurationEntry, ...]:
        """All states: those of the file, or the only one, with the test of [test].

        That is called "as the deck", or "as imported" where the model is made of matrices.
        """
        return self.configuration or (only_configuration(self.test, "as imported" if self.imported else "as the deck"),)

    @property
    def deck_path(self) -> Path:
        """The deck; of a study of matrices, the file of the first one."""
        return self.path_of(self.source_name)

    @property
    def source_name(self) -> str:
        """What the model is made of, as the study names it: the deck, or the file of the first matrix."""
        return self.study.deck or self.matrix[0].file

    @property
    def imported(self) -> bool:
        """True for a study of matrices."""
        return bool(self.matrix)

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
