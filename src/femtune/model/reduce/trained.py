"""What a training of a reduced model is asked for and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from femtune.model.reduce.basis import NEGLIGIBLE
from femtune.model.reduce.estimate import Estimator
from femtune.model.reduce.reduced_model import ReducedModel
from femtune.model.symmetric import SymmetricMatrix

Reals = NDArray[np.float64]


class TrainingStatus(Enum):
    """How the training of a reduced model ended; the best model so far is kept."""

    CONVERGED = "the estimate is below the tolerance at all candidates"
    SOLUTIONS = "all the full solutions that were allowed are used; the estimate is above the tolerance somewhere"
    ORDER = "the basis has the order that was allowed; the estimate is above the tolerance somewhere"
    UNFINISHED = "the training goes on"

    @property
    def ok(self) -> bool:
        """True where the tolerance was reached."""
        return self is TrainingStatus.CONVERGED


@dataclass(frozen=True)
class TrainingRules:
    """What a reduced model is trained to.

    Parameters
    ----------
    count : modes that matter, the lowest ones
    tolerance : relative frequency error, by the estimate
    full_solutions : how many times the full model may be solved
    order : largest order of the basis
    inner, corners : candidates inside the box and at corners of it
    negligible : see `extend`
    """

    count: int
    tolerance: float = 1e-3
    full_solutions: int = 15
    order: int = 600
    inner: int = 48
    corners: int = 0
    negligible: float = NEGLIGIBLE


@dataclass(frozen=True, eq=False)
class Certified:
    """A point where the full model was solved.

    Parameters
    ----------
    eigenvalues : (m,) of the full model
    estimate : worst estimated frequency error there before, NaN where none was made
    error : worst true frequency error of the model before its basis had the modes of this point, NaN at the first one
    order : of the basis afterwards
    """

    x: Reals
    eigenvalues: Reals
    estimate: float
    error: float
    order: int


@dataclass(frozen=True, eq=False)
class Trained:
    """A reduced model with its basis and what is known of its errors.

    Parameters
    ----------
    model, basis : V (n_free, r), VᵀA0V = 1 with A0 = K0 − σM0
    certified : points where the full model was solved, in their order
    points, estimates : (c, k) candidates, and (c,) the last worst estimate made at each; infinite where none was
    status : how the training stands
    """

    model: ReducedModel
    basis: Reals = field(repr=False)
    certified: tuple[Certified, ...]
    points: Reals = field(repr=False)
    estimates: Reals = field(repr=False)
    status: TrainingStatus
    estimator: Estimator = field(repr=False)
    metric: SymmetricMatrix = field(repr=False)

    @property
    def worst_estimate(self) -> float:
        """The largest estimate at the candidates."""
        return float(self.estimates.max(initial=0.0))
