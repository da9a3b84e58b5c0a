"""How sure: distributions and intervals of parameters from repeated measurements."""

from femtune.quantify.cloud import CloudResult, CloudRules, CloudStep, propagate, update_cloud
from femtune.quantify.covariance_matrix import correlation_of, covariance_distance
from femtune.quantify.eigenvalue_outputs import EigenvalueOutputs, FrequenciesByOrder, definite_signs
from femtune.quantify.estimator import Estimator, estimator
from femtune.quantify.forward import ForwardCheck, ellipse, forward_check
from femtune.quantify.hypercube import latin_hypercube
from femtune.quantify.interval_update import IntervalResult, interval_update
from femtune.quantify.intervals import Bounds, interval_bounds
from femtune.quantify.means import Means, MeanStep, update_means
from femtune.quantify.outputs import Counted, FrequencyOutputs, FunctionOutputs, Outputs, frequency_outputs
from femtune.quantify.repeats import OutputStatistics, given_statistics, statistics_of_repeats
from femtune.quantify.second_order import QuadraticModel, quadratic_model
from femtune.quantify.status import StochasticStatus
from femtune.quantify.stochastic import StochasticResult, StochasticRules, stochastic_update, unexplained

__all__ = [
    "Bounds",
    "CloudResult",
    "CloudRules",
    "CloudStep",
    "Counted",
    "EigenvalueOutputs",
    "Estimator",
    "ForwardCheck",
    "FrequenciesByOrder",
    "FrequencyOutputs",
    "FunctionOutputs",
    "IntervalResult",
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
