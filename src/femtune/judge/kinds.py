"""Words of the tests of a fit, which records keep."""

from __future__ import annotations

from typing import Literal

PartFamily = Literal[
    "kinds", "modes", "comparisons", "sensors", "configurations", "priors", "bounds", "side constraint"
]
"""What a part of the residuals is one of."""
