"""The chapter's truss, Fig. 16: bars of unit stiffness by length, consistent mass, dense matrices apart from the model.

Five bays of 1 × 1 m; of bay i bar 4i+1 is vertical, 4i+2 below, 4i+3 diagonal, 4i+4 above, 21 the last vertical; the
left end is pinned.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

Reals = NDArray[np.float64]
TRUE = (3, 7, 11, 15, 19)
XY = np.array([(i, j) for j in (0.0, 1.0) for i in range(6)], float)


def bars() -> dict[int, tuple[int, int]]:
    """End nodes by number of the bar; nodes 0 to 5 below, 6 to 11 above."""
    found = {21: (5, 11)}
    for i in range(5):
        found |= {4 * i + 1: (i, 6 + i), 4 * i + 2: (i, i + 1), 4 * i + 3: (i, 7 + i), 4 * i + 4: (6 + i, 7 + i)}
    return dict(sorted(found.items()))


def matrices() -> tuple[list[Reals], Reals]:
    """Stiffness of each bar and the mass, on the free DOFs."""
    stiffness, mass = [], np.zeros((24, 24))
    for p, q in bars().values():
        span = XY[q] - XY[p]
        length = float(np.hypot(*span))
        at = np.ix_(*[[2 * p, 2 * p + 1, 2 * q, 2 * q + 1]] * 2)
        along = np.concatenate([-span, span]) / length
        one = np.zeros((24, 24))
        one[at] = np.outer(along, along) / length
        stiffness.append(one)
        mass[at] += length / 6.0 * np.kron([[2.0, 1.0], [1.0, 2.0]], np.eye(2))
    free = [i for i in range(24) if i // 2 not in (0, 6)]
    return [k[np.ix_(free, free)] for k in stiffness], mass[np.ix_(free, free)]


def sensitivities(count: int) -> tuple[Reals, Reals]:
    """λ (count,) and ∂λ/∂θ (count, 21) of factors on the bars."""
    stiffness, mass = matrices()
    values, v = eigh(sum(stiffness), mass)
    return values[:count], np.array([[v[:, j] @ k @ v[:, j] for k in stiffness] for j in range(count)])
