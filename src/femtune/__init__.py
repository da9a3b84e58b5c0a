"""femtune: finite element model updating, from a deck and a vibration test to an updated deck with its uncertainty.

``import femtune as ft`` gives all classes and functions that a script or a notebook needs. Names are imported at first
use, so that the import itself is fast. The function of a step is found by `femtune.steps.front_door` if it is not in
the list that editors and type checkers read. docs/guide/python.md has an example from deck to result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune import plot, testing
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
    from femtune.labelled import to_inference_data, to_xarray
    from femtune.modal import FrfSet, ModeSet, TimeSeries, mac
    from femtune.status import Status
    from femtune.steps.bootstrap.function import bootstrap
    from femtune.steps.candidates.function import candidates
    from femtune.steps.candidates.result import CandidatesResult
    from femtune.steps.check.function import check
    from femtune.steps.check.run import CheckResult
    from femtune.steps.compare.function import compare
    from femtune.steps.correlate.function import correlate
    from femtune.steps.correlate.result import CorrelateResult
    from femtune.steps.files import modal_test, own_model, read_deck, read_matrices, read_test, write_deck, write_test
    from femtune.steps.identify.function import identify
    from femtune.steps.identify.result import IdentifyResult
    from femtune.steps.info.function import info
    from femtune.steps.info.result import InfoResult
    from femtune.steps.init.function import init
    from femtune.steps.init.run import InitResult
    from femtune.steps.intervals.run import IntervalsResult, intervals
    from femtune.steps.modes.function import modes
    from femtune.steps.modes.result import ModesResult
    from femtune.steps.modes.simulate import simulate
    from femtune.steps.plan.function import plan
    from femtune.steps.plan.result import PlanResult
    from femtune.steps.posterior.function import posterior
    from femtune.steps.quantify.function import quantify
    from femtune.steps.quantify.result import QuantifyResult
    from femtune.steps.report.function import report
    from femtune.steps.respond.function import respond
    from femtune.steps.respond.result import RespondResult
    from femtune.steps.run.function import read_results, run
    from femtune.steps.run.result import RunResult
    from femtune.steps.screen.function import screen
    from femtune.steps.screen.result import ScreenResult
    from femtune.steps.search.function import search
    from femtune.steps.search.result import SearchResult
    from femtune.steps.select.function import select
    from femtune.steps.select.result import SelectResult
    from femtune.steps.table import table
    from femtune.steps.update.function import update
    from femtune.steps.validate.function import validate
    from femtune.steps.view.function import view
    from femtune.study.described import Model, Study
    from femtune.testdata import ModalTest
else:
    __getattr__, __dir__ = lazy_names(__name__, "femtune.steps:front_door")

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
    "IntervalsResult",
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
    "intervals",
    "mac",
    "modal_test",
    "modes",
    "own_model",
    "plan",
    "plot",
    "posterior",
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
    "table",
    "testing",
    "to_inference_data",
    "to_xarray",
    "update",
    "validate",
    "view",
    "write_deck",
    "write_test",
]
