"""ResidualBlock: what one comparison adds to r(p)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class ResidualBlock:
    """One block of r(p) = (z_model(p) − z_test)/σ.

    Parameters
    ----------
    kind : "frequency", "shape" …
    configuration : name of the configuration
    mode : label of the test mode
    values : (n,) residuals
    jacobian : (n, k) ∂r/∂x
    sd : σ; the same for all values of the block
    """

    kind: str
    configuration: str
    mode: str
    values: Reals
    jacobian: Reals
    sd: float

    @property
    def error(self) -> float:
        """Size of the misfit in the unit of z: |r|·σ."""
        return float(np.linalg.norm(self.values) * self.sd)

    @property
    def label(self) -> str:
        """Text for tables."""
        return f"{self.configuration} mode {self.mode} {self.kind}"
