"""Side constraints as extra residual rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.parameters import ParameterSet

Reals = NDArray[np.float64]
Kind = Literal["none", "minimum-change", "prior"]


@dataclass(frozen=True)
class Regularisation:
    """Rows that join r(x): ``minimum-change`` adds μ·x (x is zero at the start values, μ is `weight`: the objective
    gains μ²|x|²/2), ``prior`` adds (x − mean)/sd of each parameter (maximum a posteriori).
    """

    kind: Kind = "none"
    weight: float = 0.0

    def rows(self, parameters: ParameterSet, x: Reals) -> tuple[Reals, Reals]:
        """Values (m,) and Jacobian (m, k)."""
        k = len(x)
        if self.kind == "minimum-change":
            return self.weight * x, self.weight * np.eye(k)
        if self.kind == "prior":
            mean, sd = parameters.prior
            return (x - mean) / sd, np.diag(1.0 / sd)
        return np.zeros(0), np.zeros((0, k))
