"""Public checks for new elements, models, residuals and readers."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
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
    from femtune.testing.examples import example_deck, example_test
    from femtune.testing.own_models import check_own_model
    from femtune.testing.readers import ReaderChecks, check_reader
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ModelDerivativeChecks",
    "ReaderChecks",
    "ResidualDerivativeChecks",
    "check_contribution",
    "check_derivative_equation",
    "check_directional",
    "check_matrix_derivatives",
    "check_model",
    "check_own_model",
    "check_reader",
    "check_residual",
    "check_simple_mode",
    "check_taylor_slope",
    "example_deck",
    "example_test",
]
