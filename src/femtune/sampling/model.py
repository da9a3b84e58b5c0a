"""The residuals of an update problem at samples, with the pairs of its result followed from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError
from femtune.residuals import Evaluation, ResidualBlock, UpdateProblem
from femtune.residuals.pairing import keep_paired
from femtune.residuals.state import paired_afresh
from femtune.updating.regularisation import SideConstraint


@dataclass(frozen=True, eq=False)
class SolvedSample:
    """The model at a sample.

    Parameters
    ----------
    residuals : (n,) those of a prior last; none where the model could not be solved
    jacobian : (n, k′) by the sampled parameters, None without derivatives
    paired_anew : whether the pairing would be another one there
    problem : why the model could not be solved; "" otherwise
    """

    residuals: Reals
    jacobian: Reals | None = None
    paired_anew: bool = False
    problem: str = ""


@dataclass(frozen=True, eq=False)
class Shift:
    """What changes of the model add to its residuals: constant + slope (x − about), of the sampled parameters.

    Parameters
    ----------
    about : (k′,)
    constant : (n,)
    slope : (n, k′)
    """

    about: Reals
    constant: Reals
    slope: Reals


@dataclass(frozen=True, eq=False)
class Solving:
    """The model at samples. Called with values of the sampled parameters and whether derivatives are wanted.

    Parameters
    ----------
    at : the result, from which pairs are followed
    side : constraint of the update; its informative rows are a prior
    moving : (k′,) positions of the sampled parameters; the others stay
    shift : added to the residuals; None for the model as it is
    """

    problem: UpdateProblem
    at: Evaluation
    side: SideConstraint
    moving: Integers
    shift: Shift | None = None

    def __call__(self, task: tuple[Reals, bool]) -> SolvedSample:
        """The residuals at a sample."""
        x, derivatives = self.at.x.copy(), task[1]
        x[self.moving] = task[0]
        try:
            found = self.problem.follow(x, self.at, derivatives)
            anew = any(
                len(state.case.test) and keep_paired(state.groups, paired_afresh(state).groups) != state.groups
                for state in found.states
            )
        except FemtuneError as error:
            return SolvedSample(np.zeros(0), problem=error.what)
        return self.of(found, derivatives, anew)

    def of(self, evaluation: Evaluation, derivatives: bool = True, anew: bool = False) -> SolvedSample:
        """Residuals of an evaluation, which may have further parameters after those of the problem."""
        blocks, x = kept_blocks(evaluation), evaluation.x[: len(self.at.x)]
        prior, rows = self.side.rows(x)
        known = np.broadcast_to(self.side.informative, len(prior))
        values = np.concatenate([*(b.values for b in blocks), prior[known]])
        if self.shift is not None:
            values = values + self.shift.constant + self.shift.slope @ (x[self.moving] - self.shift.about)
        if not derivatives:
            return SolvedSample(values, None, anew)
        J = np.concatenate([*(b.jacobian[:, self.moving] for b in blocks), rows[known][:, self.moving]])
        return SolvedSample(values, J if self.shift is None else J + self.shift.slope, anew)

    @property
    def priors(self) -> int:
        """Number of rows of a prior."""
        return int(np.sum(np.broadcast_to(self.side.informative, len(self.side.rows(self.at.x)[0]))))


def kept_blocks(evaluation: Evaluation) -> list[ResidualBlock]:
    """Blocks whose values have a known distribution, as independent values of unit variance."""
    return [b.whitened() for b in evaluation.weighted if not b.without_distribution]
