"""Public checks for those who write elements, models, residuals and readers."""

from femtune.testing.contributions import check_contribution
from femtune.testing.derivatives import (
    ModelDerivativeChecks,
    ResidualDerivativeChecks,
    check_derivative_equation,
    check_directional,
    check_matrix_derivatives,
    check_model,
    check_residual,
    check_simple_mode,
    check_taylor_slope,
)

__all__ = [
    "ModelDerivativeChecks",
    "ResidualDerivativeChecks",
    "check_contribution",
    "check_derivative_equation",
    "check_directional",
    "check_matrix_derivatives",
    "check_model",
    "check_residual",
    "check_simple_mode",
    "check_taylor_slope",
]
