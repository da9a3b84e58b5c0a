"""Comparisons that are settled where they are asked first: what they leave out depends on the model, and stays so.

Which functions are zero in a model, which resonances are paired and which antiresonances have partners is seen at the
start of an update, not while a study is read, and must not change while parameters move.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from femtune.errors import Notice
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import CaseState, Residual

Settled = tuple[Residual, tuple[Notice, ...]]


@dataclass(frozen=True, eq=False)
class AtFirstState:
    """A residual that `settle` makes of the first state it is asked at.

    Parameters
    ----------
    settle : state -> the residual, and what was left out
    on_modes : as of `Residual`
    """

    settle: Callable[[CaseState], Settled]
    on_modes: bool = False
    _settled: list[Settled] = field(default_factory=list, repr=False)

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """Residual blocks; errors as of `settle` and of the residual."""
        if not self._settled:
            self._settled.append(self.settle(state))
        return self._settled[0][0].blocks(state, derivatives)

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What was left out; nothing before it was asked."""
        return self._settled[0][1] if self._settled else ()
