"""Find the parameters."""

from femtune.update.covariance import ParameterCovariance, parameter_covariance
from femtune.update.on_reduced_model import ReducedCaseFacts, ReducedUpdate, ReductionRules, update_reduced
from femtune.update.regularise import Regularisation
from femtune.update.result import Iteration, UpdateResult
from femtune.update.sensitivity_method import SensitivityMethod, update

__all__ = [
    "Iteration",
    "ParameterCovariance",
    "ReducedCaseFacts",
    "ReducedUpdate",
    "ReductionRules",
    "Regularisation",
    "SensitivityMethod",
    "UpdateResult",
    "parameter_covariance",
    "update",
    "update_reduced",
]
