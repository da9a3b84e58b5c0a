"""Identifiability of the parameters, and their selection for an update."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.selection.combinations import (
        NO_EFFECT,
        Combination,
        Identifiability,
        combination_text,
        determined,
        estimated_size,
        identifiability,
        sentences,
        undetermined_sentence,
        verdict,
    )
    from femtune.selection.energies import EnergyMap, element_energies, energy_map, strain_shares
    from femtune.selection.information import Collinearity, Information, collinearity, fisher_information
    from femtune.selection.localise import ResidualEnergy, residual_energy
    from femtune.selection.output_covariance import CosineDistances, cosine_distances
    from femtune.selection.smooth import Smoothness, SmoothnessRules, line_smoothness, smoothness
    from femtune.selection.subset import Subset, SubsetStep, forward_selection, stepwise_selection
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "NO_EFFECT",
    "Collinearity",
    "Combination",
    "CosineDistances",
    "EnergyMap",
    "Identifiability",
    "Information",
    "ResidualEnergy",
    "Smoothness",
    "SmoothnessRules",
    "Subset",
    "SubsetStep",
    "collinearity",
    "combination_text",
    "cosine_distances",
    "determined",
    "element_energies",
    "energy_map",
    "estimated_size",
    "fisher_information",
    "forward_selection",
    "identifiability",
    "line_smoothness",
    "residual_energy",
    "sentences",
    "smoothness",
    "stepwise_selection",
    "strain_shares",
    "undetermined_sentence",
    "verdict",
]
