"""Words of [posterior]: how large the errors of the data and of the model are taken to be."""

from __future__ import annotations

from typing import Literal

NoiseRule = Literal["stated", "common", "by-kind"]
"""Standard deviations as stated; one unknown factor on all of them; or one for each kind of residual."""

Discrepancy = Literal["none", "properties"]
"""No error of the model, or unknown factors on the properties, masses and supports that no parameter represents."""

Sampling = Literal["automatic", "tmcmc"]
"""Weighted samples of linearised residuals or of a surrogate, as the model allows; or transitional Markov chains."""

Route = Literal["linear", "surrogate", "tmcmc"]
"""Where the samples come from: the linearised residuals, a polynomial surrogate of the residuals, or transitional
Markov chains on the model itself."""
