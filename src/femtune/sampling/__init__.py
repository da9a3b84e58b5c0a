"""Posterior distribution of the parameters: sampled, weighted by the model itself, with noise learned from the data."""

from typing import TYPE_CHECKING

from femtune._lazy import lazy_names

if TYPE_CHECKING:
    from femtune.sampling.chains import ChainRules, ChainSamples, run_chains
    from femtune.sampling.coordinates import NormalBox
    from femtune.sampling.likelihood import Likelihood, NoiseGroup, NuisanceClass, noise_groups
    from femtune.sampling.model import Shift, SolvedSample, Solving, kept_blocks
    from femtune.sampling.sampler import GOOD_ERROR, LARGEST_K, PosteriorSamples, Sampler, SamplingRules
    from femtune.sampling.shape import Bend, bends, far_from, weighted_quantiles
    from femtune.sampling.surrogate import Known, Scaled
    from femtune.sampling.weights import SmoothedWeights, log_integral, smoothed_weights
else:
    __getattr__, __dir__ = lazy_names(__name__)

__all__ = [
    "GOOD_ERROR",
    "LARGEST_K",
    "Bend",
    "ChainRules",
    "ChainSamples",
    "Known",
    "Likelihood",
    "NoiseGroup",
    "NormalBox",
    "NuisanceClass",
    "PosteriorSamples",
    "Sampler",
    "SamplingRules",
    "Scaled",
    "Shift",
    "SmoothedWeights",
    "SolvedSample",
    "Solving",
    "bends",
    "far_from",
    "kept_blocks",
    "log_integral",
    "noise_groups",
    "run_chains",
    "smoothed_weights",
    "weighted_quantiles",
]
