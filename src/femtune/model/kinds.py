"""Methods of responses by their words in a study, and the name of the only configuration."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

FrfMethod = Literal["direct", "real-modes", "complex-modes"]
"""Methods of `femtune.model.response.frf`."""
FrfMethodWord = Literal["real modes", "complex modes", "direct"]
FRF_METHODS: Mapping[FrfMethodWord, FrfMethod] = MappingProxyType(
    {"real modes": "real-modes", "complex modes": "complex-modes", "direct": "direct"}
)
"""The same by their words in a study."""

SweepLaw = Literal["logarithmic", "linear"]
"""How the frequency of a sine sweep changes: by octaves per minute, or by Hz per second."""

BASELINE = "baseline"
"""Name of the configuration of a study without [[configuration]], and of a model alone."""
