"""Minimum change of the parameters from their nominal values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.update.regularise.choice import Weight
from femtune.update.regularise.side import LinearModel, SideConstraint
from femtune.update.regularise.weight import weighed


@dataclass(frozen=True)
class MinimumChange:
    """Rows μ·x: normalised parameters are zero at their nominal values, so that relative changes are kept small.

    The objective gains μ²|x|²/2, μ being `weight`. Source: Mottershead, Link and Friswell (2011), Eq. (18) with
    W_θ = I, of the whole change, not of one iteration's, so that the end does not depend on how many there were.
    """

    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of the parameters that move."""
        matrix = np.eye(len(at.x))[at.moving]
        return weighed(SideConstraint("minimum-change", matrix, np.zeros(len(matrix))), self.weight, at)
