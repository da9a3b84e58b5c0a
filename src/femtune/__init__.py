"""femtune: finite element model updating, from a deck and a vibration test to an updated deck with its uncertainty.

``import femtune as ft`` gives all classes and functions that a script or a notebook needs. Names are imported at first
use, so that the import itself is fast. docs/guide/python.md has an example from deck to result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune import plot, testing
    from femtune.assembly.described import Model, Study
    from femtune.dofs import Dof, DofSet
    from femtune.errors import FemtuneError
    from femtune.files.study_file.objects import Configuration
    from femtune.files.study_file.parameter import Parameter
    from femtune.files.study_file.residual import (
        AntiresonanceResidual,
        CentreOfGravityResidual,
        ComplexEigenvalueResidual,
        DampingResidual,
        DynamicResidual,
        FlexibilityResidual,
        FrequencyResidual,
        FrfResidual,
        InertiaResidual,
        MacResidual,
        MassResidual,
        ShapeResidual,
        StaticDisplacementResidual,
        StaticForceResidual,
        StrainResidual,
    )
    from femtune.labelled import to_xarray
    from femtune.modal import FrfSet, ModeSet, TimeSeries, mac
    from femtune.results.step_results import (
        CandidatesResult,
        CorrelateResult,
        InfoResult,
        ModesResult,
        PlanResult,
        QuantifyResult,
        RespondResult,
        RunResult,
        ScreenResult,
        SearchResult,
        SelectResult,
    )
    from femtune.status import Status
    from femtune.steps.files import read_deck, read_matrices, read_test, write_deck, write_test
    from femtune.steps.of_experiments import screen, search
    from femtune.steps.of_model import info, modes, plan, respond, simulate
    from femtune.steps.of_record import identify
    from femtune.steps.of_run import bootstrap, candidates, read_results, run, update, validate
    from femtune.steps.of_start import check, init
    from femtune.steps.of_study import compare, correlate, quantify, select
    from femtune.steps.of_view import view
    from femtune.steps.pages import report
    from femtune.study.first_study.check import CheckResult
    from femtune.study.first_study.make import InitResult
    from femtune.study.identification.run import IdentifyResult
    from femtune.testdata import ModalTest
else:
    __getattr__, __dir__ = lazy_names(__name__)

__version__ = "0.1.0"

__all__ = [
    "AntiresonanceResidual",
    "CandidatesResult",
    "CentreOfGravityResidual",
    "CheckResult",
    "ComplexEigenvalueResidual",
    "Configuration",
    "CorrelateResult",
    "DampingResidual",
    "Dof",
    "DofSet",
    "DynamicResidual",
    "FemtuneError",
    "FlexibilityResidual",
    "FrequencyResidual",
    "FrfResidual",
    "FrfSet",
    "IdentifyResult",
    "InertiaResidual",
    "InfoResult",
    "InitResult",
    "MacResidual",
    "MassResidual",
    "ModalTest",
    "ModeSet",
    "Model",
    "ModesResult",
    "Parameter",
    "PlanResult",
    "QuantifyResult",
    "RespondResult",
    "RunResult",
    "ScreenResult",
    "SearchResult",
    "SelectResult",
    "ShapeResidual",
    "StaticDisplacementResidual",
    "StaticForceResidual",
    "Status",
    "StrainResidual",
    "Study",
    "TimeSeries",
    "bootstrap",
    "candidates",
    "check",
    "compare",
    "correlate",
    "identify",
    "info",
    "init",
    "mac",
    "modes",
    "plan",
    "plot",
    "quantify",
    "read_deck",
    "read_matrices",
    "read_results",
    "read_test",
    "report",
    "respond",
    "run",
    "screen",
    "search",
    "select",
    "simulate",
    "testing",
    "to_xarray",
    "update",
    "validate",
    "view",
    "write_deck",
    "write_test",
]
