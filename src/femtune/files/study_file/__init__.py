"""The study file: a TOML text that describes a whole study, read strictly."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.files.study_file.bootstrap import BootstrapTable
    from femtune.files.study_file.candidates import CandidateEntry, CandidatesTable
    from femtune.files.study_file.component import ComponentEntry
    from femtune.files.study_file.configuration import (
        MEASURED,
        ConfigurationEntry,
        ConfigurationSolver,
        LeaveOutEntry,
        MassEntry,
        PairEntry,
        SingleTest,
        TestKeys,
        supports,
        switched_off,
        test_files,
    )
    from femtune.files.study_file.correlate import CorrelateTable
    from femtune.files.study_file.derived import DerivedEntry
    from femtune.files.study_file.distribution import DistributionEntry
    from femtune.files.study_file.equalise import EqualiseTable
    from femtune.files.study_file.info import ChecksTable
    from femtune.files.study_file.kinds import element_list
    from femtune.files.study_file.matrices import GenericEntry, MatrixEntry, ModelTable, VariableEntry
    from femtune.files.study_file.modes import ModesTable
    from femtune.files.study_file.options import (
        with_expansion,
        with_modes,
        with_plan,
        with_response,
        with_screen,
        with_search,
    )
    from femtune.files.study_file.output import OutputTable, StudyOutputTable
    from femtune.files.study_file.over_frequency import FrequencyTableEntry
    from femtune.files.study_file.parallel import ParallelTable
    from femtune.files.study_file.parameter import NearTable, Parameter, RegionTable
    from femtune.files.study_file.plan import PlanTable, SuspensionEntry
    from femtune.files.study_file.posterior import PosteriorTable
    from femtune.files.study_file.quantify import QuantifyTable
    from femtune.files.study_file.reading import frozen, is_deck, read_study_file, study_from_data, study_from_text
    from femtune.files.study_file.residual import Comparison, ResidualsTable
    from femtune.files.study_file.respond import LoadEntry, ResponseTable
    from femtune.files.study_file.runs import RunsModelTable
    from femtune.files.study_file.screen import ScreenTable
    from femtune.files.study_file.search import SearchTable
    from femtune.files.study_file.select import SelectTable
    from femtune.files.study_file.sensors import RigidFloorEntry, SensorEntry, SensorsTable, SensorTerm
    from femtune.files.study_file.solver import SolverTable
    from femtune.files.study_file.stage import ByHandEntry, StageEntry
    from femtune.files.study_file.study import Given, StudyFile
    from femtune.files.study_file.study_table import StudyTable
    from femtune.files.study_file.update import ReductionTable, UpdateTable
    from femtune.files.study_file.validate import HoldOutEntry, ValidateTable
    from femtune.files.study_file.vibration import VibrationEntry
    from femtune.files.study_file.write import WriteTable
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "MEASURED",
    "BootstrapTable",
    "ByHandEntry",
    "CandidateEntry",
    "CandidatesTable",
    "ChecksTable",
    "Comparison",
    "ComponentEntry",
    "ConfigurationEntry",
    "ConfigurationSolver",
    "CorrelateTable",
    "DerivedEntry",
    "DistributionEntry",
    "EqualiseTable",
    "FrequencyTableEntry",
    "GenericEntry",
    "Given",
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
    "ParallelTable",
    "Parameter",
    "PlanTable",
    "PosteriorTable",
    "QuantifyTable",
    "ReductionTable",
    "RegionTable",
    "ResidualsTable",
    "ResponseTable",
    "RigidFloorEntry",
    "RunsModelTable",
    "ScreenTable",
    "SearchTable",
    "SelectTable",
    "SensorEntry",
    "SensorTerm",
    "SensorsTable",
    "SingleTest",
    "SolverTable",
    "StageEntry",
    "StudyFile",
    "StudyOutputTable",
    "StudyTable",
    "SuspensionEntry",
    "TestKeys",
    "UpdateTable",
    "ValidateTable",
    "VariableEntry",
    "VibrationEntry",
    "WriteTable",
    "element_list",
    "frozen",
    "is_deck",
    "read_study_file",
    "study_from_data",
    "study_from_text",
    "supports",
    "switched_off",
    "test_files",
    "with_expansion",
    "with_modes",
    "with_plan",
    "with_response",
    "with_screen",
    "with_search",
]
