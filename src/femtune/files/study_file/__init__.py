"""The study file: a TOML text that describes a whole study, read strictly."""

from femtune.files.study_file.configuration import (
    ConfigurationEntry,
    LeaveOutEntry,
    MassEntry,
    PairEntry,
    SingleTest,
    TestKeys,
    overlay,
    supports,
    switched_off,
)
from femtune.files.study_file.derived import DerivedEntry
from femtune.files.study_file.generic import GenericEntry
from femtune.files.study_file.kinds import element_list
from femtune.files.study_file.matrices import MatrixEntry, ModelTable, VariableEntry
from femtune.files.study_file.options import with_modes, with_response
from femtune.files.study_file.parameter import ParameterEntry
from femtune.files.study_file.quantify import QuantifyTable, SelectTable
from femtune.files.study_file.reading import read_study_file, study_from_text
from femtune.files.study_file.region import NearTable, RegionTable
from femtune.files.study_file.response import LoadEntry, ResponseTable
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
    SensorTerm,
    StudyTable,
    UpdateTable,
    WriteTable,
)
from femtune.files.study_file.study import StudyFile
from femtune.files.study_file.validation import ChecksTable, HoldOutEntry, ValidateTable

__all__ = [
    "ChecksTable",
    "ConfigurationEntry",
    "CorrelateTable",
    "DerivedEntry",
    "GenericEntry",
    "HoldOutEntry",
    "LeaveOutEntry",
    "LoadEntry",
    "MassEntry",
    "MatrixEntry",
    "ModelTable",
    "ModesTable",
    "NearTable",
    "OutputTable",
    "PairEntry",
    "ParameterEntry",
    "QuantifyTable",
    "ReductionTable",
    "RegionTable",
    "ResidualsTable",
    "ResponseTable",
    "RigidFloorEntry",
    "SelectTable",
    "SensorEntry",
    "SensorTerm",
    "SensorsTable",
    "SingleTest",
    "StageEntry",
    "StudyFile",
    "StudyTable",
    "TestKeys",
    "UpdateTable",
    "ValidateTable",
    "VariableEntry",
    "WriteTable",
    "element_list",
    "overlay",
    "read_study_file",
    "study_from_text",
    "supports",
    "switched_off",
    "with_modes",
    "with_response",
]
