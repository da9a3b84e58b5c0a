"""Find the parameters."""

from femtune.update.belief import Belief, Learned, Misfit, first_belief, learned
from femtune.update.covariance import ParameterCovariance, parameter_covariance
from femtune.update.equation_error import EquationError, equation_error_phases
from femtune.update.multi_start import MultiStart, StartRules, multi_start, starting_points
from femtune.update.on_reduced_model import ReducedCaseFacts, ReducedUpdate, ReductionRules, update_reduced
from femtune.update.optima import Optimum, StartOutcome, StartResult
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
    WeightChoice,
    WeightStatus,
    correlated_prior,
)
from femtune.update.result import Iteration, UpdateResult
from femtune.update.search import GaussNewton, LevenbergMarquardt, LineSearch, Search
from femtune.update.sensitivity_method import SensitivityMethod, update
from femtune.update.stages import ErrorSum, Stage, StageResult, run_stage, run_stages
from femtune.update.starts_on_reduced import ReducedStarts, multi_start_reduced

__all__ = [
    "Belief",
    "Distance",
    "EquationError",
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
    "MultiStart",
    "NoRegularisation",
    "Optimum",
    "ParameterCovariance",
    "Prior",
    "ReducedCaseFacts",
    "ReducedStarts",
    "ReducedUpdate",
    "ReductionRules",
    "Regularisation",
    "Search",
    "SensitivityMethod",
    "SideConstraint",
    "Stage",
    "StageResult",
    "StartOutcome",
    "StartResult",
    "StartRules",
    "Together",
    "Truncated",
    "UpdateResult",
    "WeightChoice",
    "WeightStatus",
    "correlated_prior",
    "equation_error_phases",
    "first_belief",
    "learned",
    "multi_start",
    "multi_start_reduced",
    "parameter_covariance",
    "run_stage",
    "run_stages",
    "starting_points",
    "update",
    "update_reduced",
]
