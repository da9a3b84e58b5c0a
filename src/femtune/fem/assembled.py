"""AssembledMatrix: a matrix of the whole structure that does not come from elements, with a coefficient."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import scipy.sparse as sp

from femtune.fem.contribution import Coefficient
from femtune.fem.fields import MatrixKind


@dataclass(frozen=True, eq=False)
class AssembledMatrix:
    """coefficient(p) · A, with A = Aᵀ on the g-set in the displacement frames of the nodes.

    Parameters
    ----------
    kind : "stiffness", "mass", "viscous" or "hysteretic"
    label : name for messages, for example "K2GG STIFF"
    upper : (n_g, n_g) upper triangle with the diagonal, csr, real
    roles : positions in the value table that the coefficient needs, by name
    coefficient : (jets of shape (1,) by role, no facts) -> jet of shape (1,); plain arithmetic, complex-safe

    PARAM WTMASS does not scale it.
    """

    kind: MatrixKind
    label: str
    upper: sp.csr_array
    roles: Mapping[str, int] = field(default_factory=dict)
    coefficient: Coefficient | None = None

    def depends_on(self, touched: set[int]) -> bool:
        """True where the coefficient needs one of these entries of the value table."""
        return not touched.isdisjoint(self.roles.values())
