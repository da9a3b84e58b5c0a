"""ResidualRules: how paired modes are compared, the same in every configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from femtune.residuals.frequency import FrequencyResidual
from femtune.residuals.mac import MacResidual
from femtune.residuals.pair import ByMode, PairResidual
from femtune.residuals.scaling import Scaling
from femtune.residuals.shape import ShapeResidual


@dataclass(frozen=True)
class ResidualRules:
    """What is compared of paired modes, and how well it is known.

    Parameters
    ----------
    frequency_sd : relative standard deviation of frequencies (of eigenvalues in that form), 0 leaves them out; "test"
        takes the test's own
    shape_sd : standard deviation of the entries of scaled shapes, or of the MAC form; 0 leaves shapes out
    frequency_form : "frequency" or "eigenvalue"
    shape_form : "difference" or "mac"
    shape_scaling : of differences, see `scaled_difference`
    scatter : "stated" where the standard deviations are known, "estimated" where they are relative weights and the
        residuals tell their size
    """

    frequency_sd: float | Literal["test"] = 0.01
    shape_sd: float = 0.0
    frequency_form: Literal["frequency", "eigenvalue"] = "frequency"
    shape_form: Literal["difference", "mac"] = "difference"
    shape_scaling: Scaling = "unit-norm"
    scatter: Literal["stated", "estimated"] = "stated"

    @property
    def compare_modes(self) -> bool:
        """False where neither frequencies nor shapes are compared."""
        return bool(self.frequency_sd or self.shape_sd)

    @property
    def residual(self) -> ByMode:
        """The rules as a residual."""
        parts: list[PairResidual] = []
        if self.frequency_sd:
            parts.append(FrequencyResidual(self.frequency_sd, self.frequency_form))
        if self.shape_sd and self.shape_form == "mac":
            parts.append(MacResidual(self.shape_sd))
        elif self.shape_sd:
            parts.append(ShapeResidual(self.shape_sd, self.shape_scaling))
        return ByMode(tuple(parts))
