"""What a regularisation is: settled at the first iteration, it is rows that join the residuals, linear in x."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from femtune.parameters import ParameterSet
from femtune.update.regularise.choice import WeightChoice

Reals = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Residuals and Jacobian at the point where an update starts.

    Parameters
    ----------
    x : (k,) normalised parameters
    residuals, jacobian : (n,), (n, k), in units of the residuals' standard deviations
    moving : (k,) parameters that the update moves
    """

    parameters: ParameterSet
    x: Reals
    residuals: Reals
    jacobian: Reals
    moving: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class SideConstraint:
    """A settled regularisation: rows μ(R x − c), and combinations of parameters that hold still.

    Parameters
    ----------
    word : as a study calls it
    matrix, target : R (m, k) and c (m,)
    weight : μ; the objective gains μ²|R x − c|²/2
    informative : True for rows in units of a known standard deviation (a prior), which narrow the standard deviations
        of the result; those of other constraints are an opinion and do not; (m,) where rows differ
    choice : how the weight was found, where a rule found it
    held : (h, k) combinations v of which vᵀx may not change
    """

    word: str
    matrix: Reals
    target: Reals = field(default_factory=lambda: np.zeros(0))
    weight: float = 1.0
    informative: bool | NDArray[np.bool_] = False
    choice: WeightChoice | None = None
    held: Reals = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        object.__setattr__(self, "held", self.held.reshape(-1, self.matrix.shape[1]))

    def settle(self, at: LinearModel) -> SideConstraint:
        """Itself: nothing is left to settle."""
        return self

    def rows(self, x: Reals) -> tuple[Reals, Reals]:
        """Values (m,) and Jacobian (m, k)."""
        return self.weight * (self.matrix @ x - self.target), self.weight * self.matrix

    @property
    def prior_rows(self) -> Reals:
        """(m, k) rows that count as knowledge."""
        return self.weight * self.matrix[np.broadcast_to(self.informative, len(self.target))]


class Regularisation(Protocol):
    """What is wanted besides agreement; what follows from the first Jacobian is settled with it and kept."""

    def settle(self, at: LinearModel) -> SideConstraint:
        """The rows for an update that starts there."""
        ...
