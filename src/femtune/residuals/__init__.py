"""What is compared: residuals over configurations, and the update problem."""

from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import (
    ModalCase,
    PairingRules,
    case_without_modes,
    describe_change,
    groups_of,
    modes_at_sensors,
    pair_case,
    solve_case,
)
from femtune.residuals.pair import PairedMode, PairResidual
from femtune.residuals.problem import Evaluation, UpdateProblem
from femtune.residuals.residual import Residual
from femtune.residuals.rules import ResidualRules
from femtune.residuals.solver import ModelSolver, direct
from femtune.residuals.state import CaseState, paired_count, state_at

__all__ = [
    "CaseState",
    "Evaluation",
    "ModalCase",
    "ModelSolver",
    "PairResidual",
    "PairedMode",
    "PairingRules",
    "Residual",
    "ResidualBlock",
    "ResidualRules",
    "UpdateProblem",
    "case_without_modes",
    "describe_change",
    "direct",
    "groups_of",
    "modes_at_sensors",
    "pair_case",
    "paired_count",
    "solve_case",
    "state_at",
]
