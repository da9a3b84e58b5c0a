"""Find the parameters."""

from femtune.update.belief import Belief, Learned, Misfit, first_belief, learned
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
from femtune.update.stages import ErrorSum, Stage, StageResult, run_stage, run_stages

__all__ = [
    "Belief",
    "Distance",
    "ErrorSum",
    "GaussNewton",
    "Identical",
    "Iteration",
    "Learned",
    "LevenbergMarquardt",
    "LineSearch",
    "Link",
    "MinimumChange",
    "Misfit",
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
    "Stage",
    "StageResult",
    "Together",
    "Truncated",
    "UpdateResult",
    "correlated_prior",
    "first_belief",
    "learned",
    "parameter_covariance",
    "run_stage",
    "run_stages",
    "update",
    "update_reduced",
]
