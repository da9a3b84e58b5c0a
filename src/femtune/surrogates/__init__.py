"""Surrogates: what a table of runs says about the responses between the runs, and how far that can be trusted."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.surrogates.chaos import ChaosRules, chaos_indices, explained_variances, term_counts
    from femtune.surrogates.infill import SumOfSquares, where_better, where_wrong, with_run
    from femtune.surrogates.kriging import KrigingRules
    from femtune.surrogates.radial import RadialRules
    from femtune.surrogates.surrogate import Surrogate, SurrogateRules, fit_surrogate
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "ChaosRules",
    "KrigingRules",
    "RadialRules",
    "SumOfSquares",
    "Surrogate",
    "SurrogateRules",
    "chaos_indices",
    "explained_variances",
    "fit_surrogate",
    "term_counts",
    "where_better",
    "where_wrong",
    "with_run",
]
