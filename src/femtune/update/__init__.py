"""Find the parameters."""

from femtune.update.covariance import ParameterCovariance, parameter_covariance
from femtune.update.regularise import Regularisation
from femtune.update.result import Iteration, UpdateResult
from femtune.update.sensitivity_method import SensitivityMethod, update

__all__ = [
    "Iteration",
    "ParameterCovariance",
    "Regularisation",
    "SensitivityMethod",
    "UpdateResult",
    "parameter_covariance",
    "update",
]
