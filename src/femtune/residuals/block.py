"""ResidualBlock: what one comparison adds to r(p)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

OF_MODES = ("frequency", "shape", "MAC", "strain", "dynamic")
"""Kinds whose blocks belong to one test mode."""


@dataclass(frozen=True)
class ResidualBlock:
    """One block of r(p) = (z_model(p) − z_test)/σ.

    Parameters
    ----------
    kind : "frequency", "shape", "mass" …
    configuration : name of the configuration
    mode : label of the test mode, or of what else is compared: a load case, "total"
    values : (n,) residuals
    jacobian : (n, k) ∂r/∂x
    sd : σ relative to the size of what is compared; of values of several deviations their root mean square
    """

    kind: str
    configuration: str
    mode: str
    values: Reals
    jacobian: Reals
    sd: float

    @property
    def error(self) -> float:
        """Size of the misfit relative to what is compared: |r|·σ."""
        return float(np.linalg.norm(self.values) * self.sd)

    @property
    def label(self) -> str:
        """Text for tables."""
        word = "mode " if self.kind in OF_MODES else ""
        return f"{self.configuration} {word}{self.mode} {self.kind}"
