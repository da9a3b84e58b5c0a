"""Methods of expansion of test shapes to all model DOFs, by their words in [correlate]."""

from __future__ import annotations

from typing import Literal

from femtune.kinds import Kind, Kinds

ExpansionMethod = Literal["serep", "dynamic", "mdre"]
EXPANSION_METHODS = Kinds(
    ExpansionMethod,
    Kind("serep", "SEREP", "SEREP", ("ocallahan1989",), "femtune.correlation.expansion:serep_at"),
    Kind("dynamic", "Dynamic", "dynamic expansion", ("kidder1973",), "femtune.correlation.expansion:dynamic_at"),
    Kind(
        "mdre",
        "MDRE",
        "minimum dynamic residual (MDRE)",
        ("balmes2000",),
        "femtune.correlation.expansion:minimum_residual_at",
    ),
)
"""Labels are heads of columns, texts stand in sentences."""
