"""Quality of a set of sensors: AutoMAC, condition number and information of the target modes there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.modal import auto_mac
from femtune.planning.independence import information_of, log_det

_SINGULAR = 1e-6
"""Singular value of modes of unit size below which they are dependent at the sensors."""


@dataclass(frozen=True, eq=False)
class SensorOutcome:
    """Quality of the target modes at a set of sensors.

    Parameters
    ----------
    auto_mac : (m, m) MAC of the target modes with themselves
    condition : σ_max/σ_min of the mass-normalised shapes, inf where they are dependent
    log_det : log det ΦᵀΦ
    """

    auto_mac: Reals
    condition: float
    log_det: float

    @property
    def largest_off_diagonal(self) -> float:
        """Largest AutoMAC between two modes; 0 for one mode."""
        return float((self.auto_mac - np.diag(np.diag(self.auto_mac))).max(initial=0.0))

    @property
    def root_mean_square(self) -> float:
        """Root mean square of the entries off the diagonal; 0 for one mode."""
        m = len(self.auto_mac)
        off = self.auto_mac[~np.eye(m, dtype=bool)]
        return float(np.sqrt(np.mean(off**2))) if m > 1 else 0.0

    @property
    def worst_pair(self) -> tuple[int, int]:
        """Positions of the two modes that are most alike; (0, 0) for one mode."""
        i, j = np.unravel_index(np.argmax(np.triu(self.auto_mac, 1)), self.auto_mac.shape)
        return int(i), int(j)


def rank_of(shapes: Reals) -> int:
    """Number of linearly independent target modes at sensors (rows, m), each mode brought to unit size."""
    size = np.linalg.norm(shapes, axis=0)
    return int(np.linalg.matrix_rank(shapes / np.where(size > 0.0, size, 1.0), tol=_SINGULAR)) if shapes.size else 0


def outcome_of(shapes: Reals) -> SensorOutcome:
    """Of shapes (rows, m) at the placed sensors (error ``modal.zero-shape`` for a mode that none of them sees).

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import outcome_of
    >>> found = outcome_of(np.array([[1.0, 1.0], [1.0, -1.0], [1.0, 0.0]]))
    >>> round(found.condition, 4), found.largest_off_diagonal
    (1.2247, 0.0)
    """
    values = np.linalg.svd(shapes, compute_uv=False)
    rank = len(values) == shapes.shape[1] and values[-1] > 1e-12 * values[0]
    condition = float(values[0] / values[-1]) if rank else np.inf
    return SensorOutcome(auto_mac(shapes), condition, log_det(information_of(shapes)) if rank else -np.inf)
