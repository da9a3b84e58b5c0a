"""What the choice of a weight is: the path of the parameters, the rule, and how it ended; `weight` makes it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]

Weight = float | Literal["l-curve", "gcv"]
"""A number, or the rule by which it is found at the first iteration."""


@dataclass(frozen=True, eq=False)
class RegularisationPath:
    """What min |r + J d|² + μ²|R(x + d) − c|² gives for m weights, bounds left aside.

    Parameters
    ----------
    weights : (m,) μ, rising
    changes : (m, k) d of the parameters that move, zero for the others
    residual_norms, constraint_norms : (m,) |r + J d| and |R(x + d) − c|
    curvature : (m,) of the L-curve, log constraint norm over log residual norm; NaN where the curve stands still
    cross_validation : (m,) |r + J d|²/(n − trace of the influence matrix)², the generalised cross-validation
    """

    weights: Reals
    changes: Reals
    residual_norms: Reals
    constraint_norms: Reals
    curvature: Reals
    cross_validation: Reals


class WeightStatus(Enum):
    """How the weight was found, or why it was not; the update goes on without a constraint where it was not."""

    CORNER = "the weight is that of the L-curve's corner, where its curvature is largest"
    NO_CORNER = (
        "the L-curve bends evenly and has no corner, so that no weight balances data and constraint: the update ran "
        'without the constraint; give weight a number, or use weight = "gcv"'
    )
    MONOTONE = (
        "the curvature of the L-curve only rises towards one end of it, so that there is no corner: the update ran "
        'without the constraint; give weight a number, or use weight = "gcv"'
    )
    STANDS_STILL = (
        "data and constraint do not pull against each other, so that the weight means nothing: the update ran without "
        "the constraint"
    )
    LEAST = "the weight is that of the least generalised cross-validation"
    AT_END = (
        "generalised cross-validation falls towards one end of the weights and has no least value between: the update "
        "ran without the constraint; give weight a number"
    )
    NO_SPARE = (
        "there are no more residuals than parameters, and cross-validation needs some to spare: the update ran without "
        "the constraint; give weight a number, or measure more"
    )

    @property
    def found(self) -> bool:
        """True where there is a weight."""
        return self in (WeightStatus.CORNER, WeightStatus.LEAST)


@dataclass(frozen=True, eq=False)
class WeightChoice:
    """A weight that was found, or not, with the whole path.

    Parameters
    ----------
    rule : "l-curve" or "gcv"
    position : of the weight in the path; None where none was found
    """

    rule: Literal["l-curve", "gcv"]
    status: WeightStatus
    position: int | None
    path: RegularisationPath

    @property
    def weight(self) -> float:
        """μ, zero where none was found."""
        return 0.0 if self.position is None else float(self.path.weights[self.position])
