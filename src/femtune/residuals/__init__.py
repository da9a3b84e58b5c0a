"""What is compared: residuals of modes over configurations, and the update problem."""

from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import (
    CaseState,
    ModalCase,
    PairingRules,
    describe_change,
    groups_of,
    modes_at_sensors,
    pair_case,
    paired_count,
    solve_case,
)
from femtune.residuals.problem import Evaluation, ResidualRules, UpdateProblem
from femtune.residuals.solver import ModelSolver, direct

__all__ = [
    "CaseState",
    "Evaluation",
    "ModalCase",
    "ModelSolver",
    "PairingRules",
    "ResidualBlock",
    "ResidualRules",
    "UpdateProblem",
    "describe_change",
    "direct",
    "groups_of",
    "modes_at_sensors",
    "pair_case",
    "paired_count",
    "solve_case",
]
