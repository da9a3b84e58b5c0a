"""The smallest change of the parameters whose χ² is within a stated margin of the minimum inside the bounds.

Where the data leave combinations of parameters undetermined, the minimum of χ² is an accident of the noise: it often
lies on bounds, far from the nominal values. A point nearer to them explains the data as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from femtune.arrays import Flags, Reals
from femtune.parameters import ParameterSet
from femtune.updating.regularisation import SideConstraint
from femtune.updating.search import LocalModel, bounded_least_squares

ALLOWED = 0.25
"""Increase of χ² that is allowed: half of a standard deviation of one determined combination."""


@dataclass(frozen=True, eq=False)
class SmallestChange:
    """The smallest change from the nominal values, in prior standard deviations, and what it costs.

    It minimises χ² + μ²|x/s|² inside the bounds, with s the prior standard deviations and the weight μ for which χ²
    exceeds the minimum inside the bounds by the allowed increase or a little less.

    Parameters
    ----------
    optimum : (k,) normalised parameters at the minimum of χ² inside the bounds
    optimum_at_bound : names of the parameters that are at a bound there
    chi_square : sum of squares at that minimum, side constraints included
    allowed, increase : of the sum of squares, as allowed and as reached
    weight : μ
    optimum_size, size : length of the change from nominal in prior standard deviations, of the parameters that move,
        at the minimum and in the result
    """

    optimum: Reals
    optimum_at_bound: tuple[str, ...]
    chi_square: float
    allowed: float
    increase: float
    weight: float
    optimum_size: float
    size: float


def change_rows(parameters: ParameterSet, moving: Flags, weight: float = 1.0) -> SideConstraint:
    """Rows μ x/s of the parameters that move."""
    matrix = np.diag(1.0 / parameters.prior[1])[moving]
    return SideConstraint("smallest-change", matrix, np.zeros(len(matrix)), weight)


_LEAST_WEIGHT = 1e-7
"""Smallest weight, relative to the norm of the Jacobian: half of the digits of a double; the rows of the change then
add nothing to the sum of squares."""
_MOST_WEIGHT = 1e7
"""Largest weight: the residuals then add nothing."""


def weight_for(local: LocalModel, change: SideConstraint, x: Reals, increase: float) -> float:
    """The weight with which the linear model's sum of squares exceeds the one here by `increase`.

    Parameters
    ----------
    local : without the rows of the change
    increase : may be negative where the sum of squares here is already higher than allowed
    """
    free = local.lower < local.upper
    scale = local.scale[free]
    residuals, jacobian = local.compressed
    J, R = jacobian[:, free] * scale, change.matrix[:, free] * scale
    box = local.lower[free] / scale, local.upper[free] / scale
    offset = change.matrix @ x
    size = float(np.linalg.norm(J, 2)) or 1.0

    def excess(log_weight: float) -> float:
        mu = size * np.exp(log_weight)
        d = bounded_least_squares(np.vstack([J, mu * R]), -np.concatenate([residuals, mu * offset]), *box)
        change = J @ d
        return float(change @ (2.0 * residuals + change)) - increase

    low, high = np.log(_LEAST_WEIGHT), np.log(_MOST_WEIGHT)
    if excess(low) >= 0.0:
        return size * _LEAST_WEIGHT
    if excess(high) <= 0.0:
        return size * _MOST_WEIGHT
    return float(size * np.exp(brentq(excess, low, high, xtol=1e-3)))
