"""Distance from the values at which an update starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.update.regularise.choice import Weight
from femtune.update.regularise.side import LinearModel, SideConstraint
from femtune.update.regularise.weight import weighed


@dataclass(frozen=True)
class Distance:
    """Rows μ(x − x0)/s: x0 is where the update starts, s the prior standard deviation of each parameter.

    A parameter that may vary widely is held less than one that is known well. Source: Mottershead, Link and
    Friswell (2011), after Eq. (21).
    """

    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of the parameters that move."""
        matrix = np.diag(1.0 / at.parameters.prior[1])[at.moving]
        return weighed(SideConstraint("distance", matrix, matrix @ at.x), self.weight, at)
