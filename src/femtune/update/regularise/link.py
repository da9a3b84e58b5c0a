"""Link's weighting: a parameter is held the more, the less the data feel it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.update.regularise.choice import Weight
from femtune.update.regularise.side import LinearModel, SideConstraint
from femtune.update.regularise.weight import weighed

Reals = NDArray[np.float64]

_LEAST = 1e-12


def link_weights(jacobian: Reals) -> Reals:
    """(k,) diagonal of W_θ = mean(Γ)/mean(Γ⁻¹)·Γ⁻¹ with Γ = diag(GᵀW_ε G).

    A parameter that is not felt at all would have an infinite weight: Γ is kept above 1e-12 of its largest entry.
    """
    felt = np.einsum("ij,ij->j", jacobian, jacobian)
    top = felt.max(initial=0.0)
    if not top > 0.0:
        return np.ones(len(felt))
    gamma = np.maximum(felt, _LEAST * top)
    return np.asarray(gamma.mean() / (1.0 / gamma).mean() / gamma)


@dataclass(frozen=True)
class Link:
    """Rows μ·√W_θ·x with the weights of the first Jacobian; the objective gains μ²xᵀW_θx/2.

    Source: Mottershead, Link and Friswell (2011), Eqs. (19) to (21).
    """

    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of the parameters that move."""
        matrix = np.zeros((int(at.moving.sum()), len(at.x)))
        matrix[:, at.moving] = np.diag(np.sqrt(link_weights(at.jacobian[:, at.moving])))
        return weighed(SideConstraint("link", matrix, np.zeros(len(matrix))), self.weight, at)
