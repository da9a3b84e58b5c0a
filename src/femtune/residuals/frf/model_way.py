"""How the model's functions are computed for a residual, and what that needs solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from femtune.errors import Notice
from femtune.model import EigenSolution, ModelPoint
from femtune.model.full_model import direct
from femtune.model.kinds import FrfMethod
from femtune.model.response import TIMES_HIGHEST_LINE, DampingRatios
from femtune.residuals.case import CaseState, Residual
from femtune.residuals.weights import ResidualBlock

ModesWanted = tuple[int | None, float | None]


@dataclass(frozen=True)
class ModelWay:
    """See `femtune.model.response.frf_methods`.

    Parameters
    ----------
    modes : number of modes or upper frequency that are solved for; None: not yet settled, up to twice the highest line
        at each state
    damping : modal damping besides that of the model
    residual_vectors : whether static responses to inputs and outputs are added to the modes
    limit : what limits the number of modes, in words; "" if it follows from the highest line
    decay : σ in rad/s; the functions are those at s = σ + iω, as forces and responses with an exponential window
        e^{−σt} have them
    """

    method: FrfMethod = "real-modes"
    modes: ModesWanted | None = None
    damping: DampingRatios | None = None
    residual_vectors: bool = True
    limit: str = ""
    decay: float = 0.0

    def needs_modes(self, point: ModelPoint) -> bool:
        """False where the functions are solved for at each line, and nothing damps modes."""
        return self.method != "direct" or self.damping is not None or bool(point.mode_ratios)

    def model(self, state: CaseState, highest_hz: float) -> ModelPoint | EigenSolution:
        """The full model at a state, solved where this way needs modes for lines up to `highest_hz`."""
        if not self.needs_modes(state.full):
            return state.full
        return full_modes(state, self.modes or (None, TIMES_HIGHEST_LINE * highest_hz))

    def of(self, model: ModelPoint | EigenSolution) -> ModelWay:
        """The way with the number of modes of a solution, where it has no number and needs modes."""
        if self.modes is not None or not isinstance(model, EigenSolution) or not self.needs_modes(model.point):
            return self
        return replace(self, modes=(model.wanted, None))

    def settled(self, state: CaseState, highest_hz: float) -> ModelWay:
        """The way with a fixed number of modes, those up to twice the highest line at this state.

        Functions are smooth in the parameters as long as the number of modes stays. Those of the configuration are
        taken if they are enough, so that they are solved for once.
        """
        if self.modes is not None or not self.needs_modes(state.full):
            return self
        case, top = state.case, TIMES_HIGHEST_LINE * highest_hz
        modes = full_modes(state, (None, top))
        number = modes.wanted
        # a number that is too small is seen without a solution, whose factors would stay
        enough = case.count is None or case.count >= number if case.max_hz is None else case.max_hz >= top
        shared = case.full is None and enough and state.solution.wanted >= number
        if not shared:
            # those that have just been found serve the residual too
            state.further[number, None] = modes
        return replace(self, modes=(case.count, case.max_hz) if shared else (number, None))


def full_modes(state: CaseState, modes: ModesWanted | None, start: EigenSolution | None = None) -> EigenSolution:
    """Modes of the full model at a state, solved from modes nearby where they are given; those of the configuration
    where nothing is said."""
    case = state.case
    wanted = modes or (case.count, case.max_hz)
    if case.full is None and wanted == (case.count, case.max_hz):
        return state.solution
    if wanted not in state.further:
        solver = case.solver if case.full is None else direct
        state.further[wanted] = solver.modes(state.full, *wanted, *(() if start is None else (start,)))
    return state.further[wanted]


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
    limited : lowest and highest frequency -> the same of a band only
    """

    settle: Callable[[CaseState], Settled]
    limited: Callable[[float, float], Residual] | None = field(default=None, repr=False)
    _settled: list[Settled] = field(default_factory=list, repr=False)

    def blocks(self, state: CaseState, derivatives: bool) -> Sequence[ResidualBlock]:
        """Residual blocks; errors as of `settle` and of the residual."""
        self.settle_at(state)
        return self._settled[0][0].blocks(state, derivatives)

    def settle_at(self, state: CaseState) -> None:
        """Make the residual of a state, unless it was made; errors as of `settle`."""
        if not self._settled:
            self._settled.append(self.settle(state))

    def in_band(self, low_hz: float, high_hz: float) -> Residual:
        """See `Residual`; it is settled again."""
        return self if self.limited is None else self.limited(low_hz, high_hz)

    @property
    def settled(self) -> Residual | None:
        """The residual; None before it was asked."""
        return self._settled[0][0] if self._settled else None

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices of what was left out; none until the residual is settled."""
        return self._settled[0][1] if self._settled else ()


def settle_all(state: CaseState) -> None:
    """Make all comparisons of a case that a state has to settle; errors as of their `settle`."""
    for residual in state.case.residuals:
        if isinstance(residual, AtFirstState):
            residual.settle_at(state)


def settled(residual: Residual) -> Residual:
    """The settled residual; the residual itself if there is nothing to settle, or it has not been settled yet."""
    modes = residual.settled if isinstance(residual, AtFirstState) else None
    return modes or residual
