"""Which parameters the data can determine, and which of them are worth updating."""

from femtune.select.collinearity import Collinearity, collinearity
from femtune.select.energies import EnergyMap, element_energies, energy_map
from femtune.select.identifiability import NO_EFFECT, Combination, Identifiability, determined, identifiability
from femtune.select.information import Information, fisher_information
from femtune.select.localise import ResidualEnergy, residual_energy
from femtune.select.output_covariance import CosineDistances, cosine_distances
from femtune.select.subset import Subset, SubsetStep, forward_selection, stepwise_selection
from femtune.select.words import combination_text, sentences, verdict

__all__ = [
    "NO_EFFECT",
    "Collinearity",
    "Combination",
    "CosineDistances",
    "EnergyMap",
    "Identifiability",
    "Information",
    "ResidualEnergy",
    "Subset",
    "SubsetStep",
    "collinearity",
    "combination_text",
    "cosine_distances",
    "determined",
    "element_energies",
    "energy_map",
    "fisher_information",
    "forward_selection",
    "identifiability",
    "residual_energy",
    "sentences",
    "stepwise_selection",
    "verdict",
]
