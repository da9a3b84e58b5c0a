"""How the model's functions are computed for a residual, and what that needs solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from femtune.errors import Notice
from femtune.model import EigenSolution, ModelPoint
from femtune.model.full_model import direct
from femtune.model.response import DampingRatios, Method
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.weights import ResidualBlock

ModesWanted = tuple[int | None, float | None]


@dataclass(frozen=True)
class ModelWay:
    """See `femtune.model.response.frf_methods`.

    Parameters
    ----------
    modes : number of modes or upper frequency that are solved for; None takes those of the configuration
    damping : modal damping besides that of the model
    """

    method: Method = "real-modes"
    modes: ModesWanted | None = None
    damping: DampingRatios | None = None
    residual_vectors: bool = True

    def model(self, state: CaseState) -> ModelPoint | EigenSolution:
        """The full model at a state, solved where this way needs modes."""
        full = state.full
        if self.method == "direct" and self.damping is None and not full.mode_ratios:
            return full
        return full_modes(state, self.modes)


def full_modes(state: CaseState, modes: ModesWanted | None) -> EigenSolution:
    """Modes of the full model at a state; those of the configuration where nothing is said."""
    case = state.case
    if case.full is None and modes is None:
        return state.solution
    solver = case.solver if case.full is None else direct
    return solver.modes(state.full, *(modes or (case.count, case.max_hz)))


# ----------------------------------------------------------------------------------------------------
# Comparisons that are settled where they are asked first: what they leave out depends on the model, and stays so.
#
# Which functions are zero in a model, which resonances are paired and which antiresonances have partners is seen at
# the start of an update, not while a study is read, and must not change while parameters move.


Settled = tuple[Residual, tuple[Notice, ...]]


@dataclass(frozen=True, eq=False)
class AtFirstState(Residual):
    """A residual that `settle` makes of the first state it is asked at.

    Parameters
    ----------
    settle : state -> the residual, and what was left out
    """

    settle: Callable[[CaseState], Settled]
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
