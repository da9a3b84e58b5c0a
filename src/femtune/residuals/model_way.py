"""How the model's functions are computed for a residual, and what that needs solved."""

from __future__ import annotations

from dataclasses import dataclass

from femtune.model import EigenSolution, ModelPoint
from femtune.model.response import DampingRatios, Method
from femtune.residuals.case import CaseState
from femtune.residuals.solver import direct

ModesWanted = tuple[int | None, float | None]


@dataclass(frozen=True)
class ModelWay:
    """See `femtune.model.response.frf`.

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
