"""Uncertainty: distributions and intervals of parameters from repeated measurements."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.uncertainty.bootstrap import (
        Bootstrap,
        BootstrapParameter,
        BootstrapResult,
        BootstrapRules,
        BootstrapRun,
        bootstrap_of,
        bootstrap_result,
    )
    from femtune.uncertainty.forward import ForwardCheck, ellipse, forward_check
    from femtune.uncertainty.held_out import Fit, HeldOutCheck, check_held_out, held_out_repeats
    from femtune.uncertainty.intervals import Bounds, IntervalResult, interval_bounds, interval_update
    from femtune.uncertainty.order_tests import OrderDependence, order_dependence
    from femtune.uncertainty.outputs import (
        Counted,
        EigenvalueOutputs,
        FrequenciesByOrder,
        FrequencyOutputs,
        FunctionOutputs,
        ModeOutputs,
        Outputs,
        ShapeOutputs,
        definite_signs,
        frequency_outputs,
        second_derivatives,
        shape_outputs,
    )
    from femtune.uncertainty.population import (
        MIXED_POPULATION,
        PopulationRules,
        PopulationSamples,
        sample_population,
    )
    from femtune.uncertainty.repeat_checks import RepeatChecks, check_repeats
    from femtune.uncertainty.repeats import (
        OutputStatistics,
        correlation_of,
        covariance_distance,
        given_statistics,
        statistics_of_repeats,
    )
    from femtune.uncertainty.robust import RobustMoments, robust_moments
    from femtune.uncertainty.specimens import (
        CommonTest,
        Spread,
        adjusted,
        common_test,
        common_test_of_estimates,
        spread_of,
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
    "MIXED_POPULATION",
    "Bootstrap",
    "BootstrapParameter",
    "BootstrapResult",
    "BootstrapRules",
    "BootstrapRun",
    "Bounds",
    "CloudResult",
    "CloudRules",
    "CloudStep",
    "CommonTest",
    "Counted",
    "EigenvalueOutputs",
    "Fit",
    "ForwardCheck",
    "FrequenciesByOrder",
    "FrequencyOutputs",
    "FunctionOutputs",
    "HeldOutCheck",
    "IntervalResult",
    "LinearEstimator",
    "MeanStep",
    "Means",
    "ModeOutputs",
    "OrderDependence",
    "OutputStatistics",
    "Outputs",
    "PopulationRules",
    "PopulationSamples",
    "QuadraticModel",
    "RepeatChecks",
    "RobustMoments",
    "ShapeOutputs",
    "Spread",
    "StochasticResult",
    "StochasticRules",
    "StochasticStatus",
    "adjusted",
    "bootstrap_of",
    "bootstrap_result",
    "check_held_out",
    "check_repeats",
    "common_test",
    "common_test_of_estimates",
    "correlation_of",
    "covariance_distance",
    "definite_signs",
    "ellipse",
    "estimator",
    "forward_check",
    "frequency_outputs",
    "given_statistics",
    "held_out_repeats",
    "interval_bounds",
    "interval_update",
    "latin_hypercube",
    "order_dependence",
    "propagate",
    "quadratic_model",
    "robust_moments",
    "sample_population",
    "second_derivatives",
    "shape_outputs",
    "spread_of",
    "statistics_of_repeats",
    "stochastic_update",
    "unexplained",
    "update_cloud",
    "update_means",
]
