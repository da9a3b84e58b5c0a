"""Forms that some kinds of residual have, by the words of a study."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from femtune.kinds import Kind, Kinds

FrequencyForm = Literal["frequency", "eigenvalue"]
RELATIVE_TO_FREQUENCY: Mapping[FrequencyForm, float] = MappingProxyType({"frequency": 1.0, "eigenvalue": 2.0})
"""Relative error of what is compared over that of the frequency: λ = ω²."""

ShapeScaling = Literal["unit-norm", "largest-entry", "scale-factor", "mass"]
"""Scale in which model and test shape are compared, see `femtune.residuals.shape.scaled_difference`."""

MacForm = Literal["root", "ratio", "difference"]
"""(1 − √MAC)/√MAC, (1 − MAC)/MAC, or 1 − MAC."""

FrfForm = Literal["linear", "log-magnitude", "log-complex"]
FRF_FORMS = Kinds(
    FrfForm,
    Kind("linear", "differences of the values", function="femtune.residuals.frf.residual:LINEAR"),
    Kind("log-magnitude", "logarithms of the ratio of the magnitudes",
         function="femtune.residuals.frf.residual:LOG_MAGNITUDE"),
    Kind("log-complex", "logarithms of the complex ratio", function="femtune.residuals.frf.residual:LOG_COMPLEX"),
)  # fmt: skip
"""How model and measured FRFs are compared."""

Scatter = Literal["stated", "estimated"]
"""Whether standard deviations are known, or relative weights whose common factor is estimated from the residuals."""
