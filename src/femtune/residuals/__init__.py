"""What is compared: residuals over configurations, and the update problem."""

from femtune.residuals.antiresonance import AntiresonanceResidual, antiresonance_residual
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import CaseState, ModalCase, PairedMode, PairingRules, Residual, case_without_modes
from femtune.residuals.frf import FrfResidual
from femtune.residuals.frf_choice import frf_residual
from femtune.residuals.frf_forms import FrfForm
from femtune.residuals.frf_lines import Band, Region, Resonance, Resonances
from femtune.residuals.frf_places import Places, places_of
from femtune.residuals.frf_scatter import FrfScatter
from femtune.residuals.measured_zeros import Antiresonance, ZeroSearch, measured_antiresonances
from femtune.residuals.model_way import ModelWay
from femtune.residuals.pair import OfModes, OfPairs, PairResidual
from femtune.residuals.pairing import describe_change, groups_of, modes_at_sensors, pair_case, solve_case
from femtune.residuals.problem import Evaluation, UpdateProblem
from femtune.residuals.rules import ResidualRules
from femtune.residuals.solver import ModelSolver, direct
from femtune.residuals.state import paired_count, state_at
from femtune.residuals.zero_pairs import ZeroGates

__all__ = [
    "Antiresonance",
    "AntiresonanceResidual",
    "Band",
    "CaseState",
    "Evaluation",
    "FrfForm",
    "FrfResidual",
    "FrfScatter",
    "ModalCase",
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
    "ResidualRules",
    "Resonance",
    "Resonances",
    "UpdateProblem",
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
    "paired_count",
    "places_of",
    "solve_case",
    "state_at",
]
