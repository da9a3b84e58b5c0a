"""Nominally identical parameters: their differences are kept small."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.parameters import ParameterSet
from femtune.update.regularise.choice import Weight
from femtune.update.regularise.names import position
from femtune.update.regularise.side import LinearModel, SideConstraint
from femtune.update.regularise.weight import weighed

Reals = NDArray[np.float64]


@dataclass(frozen=True)
class Identical:
    """Rows μ(P_i − mean P)/|scale| over each group of parameters, the side constraint Cθ = 0.

    The sum of their squares is that of all differences within a group over its number of parameters. 1/`weight` is the
    relative scatter that the parameters are thought to have. Source: Ahmadian, Mottershead and Friswell (1998);
    Mottershead, Link and Friswell (2011), after Eq. (21).

    Parameters
    ----------
    groups : names of free parameters, two or more a group
    """

    groups: tuple[tuple[str, ...], ...]
    weight: Weight

    def settle(self, at: LinearModel) -> SideConstraint:
        """Rows of all groups.

        Raises
        ------
        FemtuneError : ``update.unknown-parameter``
        """
        parts = [_differences(at.parameters, group) for group in self.groups]
        matrix = np.vstack([np.zeros((0, len(at.x))), *(rows for rows, _ in parts)])
        target = np.concatenate([np.zeros(0), *(values for _, values in parts)])
        return weighed(SideConstraint("identical", matrix, target), self.weight, at)


def _differences(parameters: ParameterSet, group: tuple[str, ...]) -> tuple[Reals, Reals]:
    """Deviations from the group's mean in units of its mean scale: matrix by x, and what it is at x = 0, negative."""
    at = [position(parameters, name) for name in group]
    deviation = np.eye(len(at)) - 1.0 / len(at)
    unit = parameters.scale[at].mean()
    matrix = np.zeros((len(at), len(parameters.free)))
    matrix[:, at] = deviation * (parameters.scale[at] / unit)
    return matrix, -deviation @ parameters.nominal[at] / unit
