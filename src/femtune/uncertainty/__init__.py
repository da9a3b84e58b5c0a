"""Uncertainty: distributions and intervals of parameters from repeated measurements."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.uncertainty.forward import ForwardCheck, ellipse, forward_check
    from femtune.uncertainty.intervals import Bounds, IntervalResult, interval_bounds, interval_update
    from femtune.uncertainty.outputs import (
        Counted,
        EigenvalueOutputs,
        FrequenciesByOrder,
        FrequencyOutputs,
        FunctionOutputs,
        Outputs,
        definite_signs,
        frequency_outputs,
    )
    from femtune.uncertainty.repeats import (
        OutputStatistics,
        correlation_of,
        covariance_distance,
        given_statistics,
        statistics_of_repeats,
    )
    from femtune.uncertainty.stochastic import (
        CloudResult,
        CloudRules,
        CloudStep,
        LinearEstimator,
        Means,
        MeanStep,
        QuadraticModel,
        StochasticResult,
        StochasticRules,
        StochasticStatus,
        estimator,
        latin_hypercube,
        propagate,
        quadratic_model,
        stochastic_update,
        unexplained,
        update_cloud,
        update_means,
    )
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Bounds",
    "CloudResult",
    "CloudRules",
    "CloudStep",
    "Counted",
    "EigenvalueOutputs",
    "ForwardCheck",
    "FrequenciesByOrder",
    "FrequencyOutputs",
    "FunctionOutputs",
    "IntervalResult",
    "LinearEstimator",
    "MeanStep",
    "Means",
    "OutputStatistics",
    "Outputs",
    "QuadraticModel",
    "StochasticResult",
    "StochasticRules",
    "StochasticStatus",
    "correlation_of",
    "covariance_distance",
    "definite_signs",
    "ellipse",
    "estimator",
    "forward_check",
    "frequency_outputs",
    "given_statistics",
    "interval_bounds",
    "interval_update",
    "latin_hypercube",
    "propagate",
    "quadratic_model",
    "statistics_of_repeats",
    "stochastic_update",
    "unexplained",
    "update_cloud",
    "update_means",
]
