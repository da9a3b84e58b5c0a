"""Residuals over configurations, and the update problem."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.model.full_model import ModelSolver, direct
    from femtune.residuals.case import (
        CaseState,
        ComparedCase,
        PairedMode,
        PairingRules,
        Residual,
        case_without_modes,
    )
    from femtune.residuals.dynamic import DynamicResidual
    from femtune.residuals.flexibility import FlexibilityResidual
    from femtune.residuals.frequency import FrequencyCovariance, FrequencyResidual
    from femtune.residuals.frf.antiresonance import AntiresonanceResidual, ZeroGates, antiresonance_residual
    from femtune.residuals.frf.choice import frf_residual
    from femtune.residuals.frf.lines import Band, Region, Resonance, Resonances
    from femtune.residuals.frf.measured_zeros import Antiresonance, ZeroSearch, measured_antiresonances
    from femtune.residuals.frf.model_way import ModelWay
    from femtune.residuals.frf.residual import FrfForm, FrfResidual, Places, places_of
    from femtune.residuals.frf.scatter import FrfScatter
    from femtune.residuals.mac import MacResidual
    from femtune.residuals.mass import CentreResidual, InertiaResidual, MassResidual
    from femtune.residuals.pair import ByMode, OfModes, OfPairs, PairResidual
    from femtune.residuals.pairing import describe_change, groups_of, modes_at_sensors, pair_case, solve_case
    from femtune.residuals.poles import ComplexEigenvalueResidual, DampingResidual
    from femtune.residuals.problem import Evaluation, Scatter, UpdateProblem
    from femtune.residuals.shape import ShapeResidual, StrainResidual
    from femtune.residuals.state import state_at
    from femtune.residuals.static import DisplacementResidual, ForceResidual, StaticTest
    from femtune.residuals.weights import ResidualBlock, Weights
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Antiresonance",
    "AntiresonanceResidual",
    "Band",
    "ByMode",
    "CaseState",
    "CentreResidual",
    "ComparedCase",
    "ComplexEigenvalueResidual",
    "DampingResidual",
    "DisplacementResidual",
    "DynamicResidual",
    "Evaluation",
    "FlexibilityResidual",
    "ForceResidual",
    "FrequencyCovariance",
    "FrequencyResidual",
    "FrfForm",
    "FrfResidual",
    "FrfScatter",
    "InertiaResidual",
    "MacResidual",
    "MassResidual",
    "ModelSolver",
    "ModelWay",
    "OfModes",
    "OfPairs",
    "PairResidual",
    "PairedMode",
    "PairingRules",
    "Places",
    "Region",
    "Residual",
    "ResidualBlock",
    "Resonance",
    "Resonances",
    "Scatter",
    "ShapeResidual",
    "StaticTest",
    "StrainResidual",
    "UpdateProblem",
    "Weights",
    "ZeroGates",
    "ZeroSearch",
    "antiresonance_residual",
    "case_without_modes",
    "describe_change",
    "direct",
    "frf_residual",
    "groups_of",
    "measured_antiresonances",
    "modes_at_sensors",
    "pair_case",
    "places_of",
    "solve_case",
    "state_at",
]
