"""Find the parameters."""

from femtune.update.covariance import ParameterCovariance, parameter_covariance
from femtune.update.on_reduced_model import ReducedCaseFacts, ReducedUpdate, ReductionRules, update_reduced
from femtune.update.regularise import (
    Distance,
    Identical,
    Link,
    MinimumChange,
    NoRegularisation,
    Prior,
    Regularisation,
    SideConstraint,
    Together,
    Truncated,
    correlated_prior,
)
from femtune.update.result import Iteration, UpdateResult
from femtune.update.search import GaussNewton, LevenbergMarquardt, LineSearch, Search
from femtune.update.sensitivity_method import SensitivityMethod, update

__all__ = [
    "Distance",
    "GaussNewton",
    "Identical",
    "Iteration",
    "LevenbergMarquardt",
    "LineSearch",
    "Link",
    "MinimumChange",
    "NoRegularisation",
    "ParameterCovariance",
    "Prior",
    "ReducedCaseFacts",
    "ReducedUpdate",
    "ReductionRules",
    "Regularisation",
    "Search",
    "SensitivityMethod",
    "SideConstraint",
    "Together",
    "Truncated",
    "UpdateResult",
    "correlated_prior",
    "parameter_covariance",
    "update",
    "update_reduced",
]
