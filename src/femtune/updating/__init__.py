"""Find the parameters."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.updating.covariance import Box, ParameterCovariance, parameter_covariance
    from femtune.updating.equation_error import EquationError, equation_error_phases
    from femtune.updating.minimum import MinimumRules, look_further
    from femtune.updating.on_reduced_model import (
        NOBODY,
        FrfAgreement,
        ReducedCaseFacts,
        ReducedComponent,
        ReducedSearch,
        ReducedStarts,
        ReducedUpdate,
        ReductionRules,
        Told,
        multi_start_reduced,
        update_reduced,
    )
    from femtune.updating.posterior import BoxPosterior, Marginal, posterior_of_covariance
    from femtune.updating.prior import Prior, correlated_prior
    from femtune.updating.regularisation import (
        Distance,
        EachStep,
        Identical,
        Link,
        MinimumChange,
        NoRegularisation,
        Regularisation,
        SideConstraint,
        Together,
        Truncated,
        WeightChoice,
        WeightStatus,
    )
    from femtune.updating.result import Iteration, MinimumSearch, UpdateResult
    from femtune.updating.search import GaussNewton, LevenbergMarquardt, LineSearch, Search
    from femtune.updating.sensitivity_method import SensitivityMethod, not_narrowed, update, with_noise
    from femtune.updating.stages import (
        Belief,
        ErrorSum,
        Learned,
        Misfit,
        SetByHand,
        Stage,
        StageResult,
        first_belief,
        learned,
        run_stage,
        run_stages,
    )
    from femtune.updating.starts import (
        MultiStart,
        Optimum,
        Sample,
        StartOutcome,
        StartResult,
        StartRules,
        multi_start,
        starting_points,
    )
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "NOBODY",
    "Belief",
    "Box",
    "BoxPosterior",
    "Distance",
    "EachStep",
    "EquationError",
    "ErrorSum",
    "FrfAgreement",
    "GaussNewton",
    "Identical",
    "Iteration",
    "Learned",
    "LevenbergMarquardt",
    "LineSearch",
    "Link",
    "Marginal",
    "MinimumChange",
    "MinimumRules",
    "MinimumSearch",
    "Misfit",
    "MultiStart",
    "NoRegularisation",
    "Optimum",
    "ParameterCovariance",
    "Prior",
    "ReducedCaseFacts",
    "ReducedComponent",
    "ReducedSearch",
    "ReducedStarts",
    "ReducedUpdate",
    "ReductionRules",
    "Regularisation",
    "Sample",
    "Search",
    "SensitivityMethod",
    "SetByHand",
    "SideConstraint",
    "Stage",
    "StageResult",
    "StartOutcome",
    "StartResult",
    "StartRules",
    "Together",
    "Told",
    "Truncated",
    "UpdateResult",
    "WeightChoice",
    "WeightStatus",
    "correlated_prior",
    "equation_error_phases",
    "first_belief",
    "learned",
    "look_further",
    "multi_start",
    "multi_start_reduced",
    "not_narrowed",
    "parameter_covariance",
    "posterior_of_covariance",
    "run_stage",
    "run_stages",
    "starting_points",
    "update",
    "update_reduced",
    "with_noise",
]
