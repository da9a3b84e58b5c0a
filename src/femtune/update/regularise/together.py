"""Several side constraints at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.update.regularise.side import LinearModel, Regularisation, SideConstraint


@dataclass(frozen=True)
class Together:
    """The rows of all parts: a prior and nominally identical parameters, for one.

    The parts that are no prior stay opinions: standard deviations of the result count the rows of priors only.
    """

    parts: tuple[Regularisation, ...]

    def settle(self, at: LinearModel) -> SideConstraint:
        """All rows in their weights; errors of the parts."""
        sides = [part.settle(at) for part in self.parts]
        none = np.zeros((0, len(at.x)))
        rows = np.vstack([none, *(s.weight * s.matrix for s in sides)])
        target = np.concatenate([np.zeros(0), *(s.weight * s.target for s in sides)])
        held = np.vstack([none, *(s.held for s in sides)])
        known = np.concatenate([np.zeros(0, bool), *(np.full(len(s.target), s.informative) for s in sides)])
        word = " and ".join(s.word for s in sides) or "none"
        return SideConstraint(word, rows, target, informative=known, held=held)
