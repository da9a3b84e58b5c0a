"""Designs of experiments, and what runs say about the effect of each factor."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.experiments.arrays import OrthogonalArray, array_names, hadamard, orthogonal_array, smallest_array
    from femtune.experiments.designs import (
        Design,
        by_levels,
        central_composite,
        full_factorial,
        latin_hypercube,
        nested_latin_hypercube,
        orthogonal_design,
        plackett_burman,
        sample,
        sobol,
    )
    from femtune.experiments.indices import (
        ElementaryEffects,
        VarianceIndices,
        elementary_effects,
        morris_design,
        sobol_design,
        sobol_indices,
        variance_indices,
    )
    from femtune.experiments.variance import Effects, main_effects
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "Design",
    "Effects",
    "ElementaryEffects",
    "OrthogonalArray",
    "VarianceIndices",
    "array_names",
    "by_levels",
    "central_composite",
    "elementary_effects",
    "full_factorial",
    "hadamard",
    "latin_hypercube",
    "main_effects",
    "morris_design",
    "nested_latin_hypercube",
    "orthogonal_array",
    "orthogonal_design",
    "plackett_burman",
    "sample",
    "smallest_array",
    "sobol",
    "sobol_design",
    "sobol_indices",
    "variance_indices",
]
