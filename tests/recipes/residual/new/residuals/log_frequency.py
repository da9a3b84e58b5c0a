"""Logarithmic frequency residual: ln(f/f_e), the same for a frequency that is too high or too low by one factor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.residuals.asked import Asked
from femtune.residuals.case import PairedMode
from femtune.residuals.pair import PairResidual
from femtune.residuals.weights import ResidualBlock


@dataclass(frozen=True)
class LogFrequencyResidual(PairResidual):
    """ln(f/f_e) with the relative standard deviation `sd`."""

    sd: float
    key = "log-frequency"
    label = "frequency ratio"

    @classmethod
    def of_study(cls, asked: Asked) -> LogFrequencyResidual:
        """See `Residual`."""
        return cls(asked.entry.sd)

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value a mode: f = √λ/2π, so that ∂ln f/∂x = ∂λ/∂x / 2λ."""
        value = 0.5 * np.log(pair.eigenvalue) - np.log(2.0 * np.pi * pair.test_hz)
        slope = pair.eigenvalue_gradient / (2.0 * pair.eigenvalue)
        return self.block(pair.case.name, pair.label, np.array([value]) / self.sd, slope[None, :] / self.sd, self.sd)
