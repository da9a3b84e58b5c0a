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

__all__ = [
    "CaseState",
    "Evaluation",
    "ModalCase",
    "PairingRules",
    "ResidualBlock",
    "ResidualRules",
    "UpdateProblem",
    "describe_change",
    "groups_of",
    "modes_at_sensors",
    "pair_case",
    "paired_count",
    "solve_case",
]
