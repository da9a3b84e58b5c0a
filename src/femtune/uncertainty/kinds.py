"""Methods of [quantify] and [bootstrap], by their words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from femtune.kinds import Kind, Kinds


@dataclass(frozen=True)
class StochasticMethod(Kind):
    """An estimate of the parameters' covariance; `samples` says that it propagates samples through the model."""

    samples: bool = False


QuantifyMethod = Literal["second-order", "perturbation", "cross-covariance", "output-difference"]
QUANTIFY_METHODS = Kinds(
    QuantifyMethod,
    StochasticMethod(
        "second-order",
        text="second-order perturbation, equation (39)",
        function="femtune.uncertainty.stochastic:by_second_order",
    ),
    StochasticMethod(
        "perturbation",
        text="linear perturbation about the mean, equation (39)",
        function="femtune.uncertainty.stochastic:by_perturbation",
    ),
    StochasticMethod(
        "cross-covariance",
        text="sampling, with the covariance of outputs and parameters, equation (40)",
        citations=("khodaparast2008",),
        function="femtune.uncertainty.stochastic:by_cross_covariance",
        samples=True,
    ),
    StochasticMethod(
        "output-difference",
        text="sampling, with the difference of the output covariances, equation (41)",
        citations=("govers2010",),
        function="femtune.uncertainty.stochastic:by_output_difference",
        samples=True,
    ),
)
"""Estimates of the parameters' covariance; the equations are those of Silva, Mottershead and others (2016)."""

MissingValues = Literal["em", "pairwise", "complete"]
"""Repeats with gaps: maximum likelihood (EM), moments of the pairs that were measured, or complete repeats alone."""

CovarianceEstimate = Literal["sample", "robust"]
"""Sample moments, or the reweighted minimum covariance determinant."""

OutputWeighting = Literal["relative", "covariance"]
"""Outputs are weighted relative to their means, or by the inverse of the measured covariance."""

Jacobian = Literal["shared", "own"]
"""Derivatives of the steps of a bootstrap run: those at the result of the update, or those of each point."""
