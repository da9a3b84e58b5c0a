"""Residual: one comparison of model and test, as the update problem sees it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from femtune.residuals.block import ResidualBlock

if TYPE_CHECKING:
    from femtune.residuals.state import CaseState


@runtime_checkable
class Residual(Protocol):
    """One comparison in one configuration: data, weights and labels inside, no algorithm.

    What it keeps belongs to the test, never to one model: it is asked on reduced models and on the written deck too.

    Parameters
    ----------
    on_modes : True where it is made of modes or of a modal basis, so that a reduced model serves it
    """

    @property
    def on_modes(self) -> bool:
        """See above."""
        ...

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """Residuals at a state of the model.

        Parameters
        ----------
        state : the model at one parameter vector; it solves for modes when they are asked for
        derivatives : whether Jacobians are wanted; without them those of the blocks have no columns
        """
        ...
