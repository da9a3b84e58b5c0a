"""Surrogates and their parts, by their words in [search] and [runs]."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from femtune.kinds import Kind, Kinds

SurrogateMethod = Literal["kriging", "radial-basis", "chaos"]
SURROGATES = Kinds(
    SurrogateMethod,
    Kind("kriging", "Kriging", citations=("sacks1989",)),
    Kind("radial-basis", "radial basis functions", citations=("duchon1977", "wahba1990")),
    Kind("chaos", "polynomial chaos", citations=("blatman2011", "sudret2008")),
)

Trend = Literal["constant", "linear", "quadratic"]
TRENDS: Mapping[Trend, int] = MappingProxyType({"constant": 0, "linear": 1, "quadratic": 2})
"""Degrees of the complete polynomials."""


CorrelationKind = Literal["gaussian", "matern-5/2", "matern-3/2", "none"]
CORRELATIONS = Kinds(
    CorrelationKind,
    Kind("gaussian", function="femtune.surrogates.correlations:GAUSSIAN"),
    Kind("matern-5/2", function="femtune.surrogates.correlations:MATERN_52"),
    Kind("matern-3/2", function="femtune.surrogates.correlations:MATERN_32"),
    Kind("none", function="femtune.surrogates.correlations:NO_CORRELATION"),
)
"""Correlation functions in the order of their smoothness; "none" is the trend alone, fitted by least squares."""

RadialKernel = Literal["cubic", "quintic", "thin-plate"]
KERNELS = Kinds(
    RadialKernel,
    Kind("cubic", function="femtune.surrogates.radial:CUBIC"),
    Kind("quintic", function="femtune.surrogates.radial:QUINTIC"),
    Kind("thin-plate", function="femtune.surrogates.radial:THIN_PLATE"),
)

Noise = Literal["estimate", "none"]
"""The noise of the runs is estimated, or the surrogate passes through all of them."""

Infill = Literal["improvement", "error"]
INFILLS = Kinds(
    Infill,
    Kind("improvement", text="runs where the objective may be better"),
    Kind("error", text="runs where the surrogate may be wrong", citations=("liu2017",)),
)
"""Where further runs are made."""

RunsOn = Literal["surrogate", "model"]
"""What a search or a screening evaluates at its points: a surrogate of designed runs, or the model itself."""
