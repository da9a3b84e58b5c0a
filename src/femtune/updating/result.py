"""UpdateResult: updated parameters, history and covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from femtune.arrays import Reals
from femtune.parameters import Jet, ParameterSet
from femtune.residuals import Evaluation
from femtune.residuals.frf.fitted import FittedFrfs
from femtune.status import Status
from femtune.updating.covariance import ParameterCovariance
from femtune.updating.kinds import TrialKind
from femtune.updating.posterior import Marginal
from femtune.updating.regularisation import SideConstraint
from femtune.updating.smallest_change import SmallestChange


@dataclass(frozen=True)
class IterationMode:
    """A paired mode at an accepted point: frequencies of test and model in Hz, MAC (NaN without a measured shape)."""

    configuration: str
    test_label: str
    test_freq_hz: float
    freq_hz: float
    mac: float


@dataclass(frozen=True)
class Iteration:
    """One accepted point.

    Parameters
    ----------
    objective : ½ rᵀr with the side constraint
    mean_error : weighted mean error of the comparisons, see `Evaluation.mean_error`
    x : normalised parameters
    step : largest change of a parameter in this iteration
    damping : state of the search after the accepted step: its damping, or the part of the whole step that it tries
    at_bound : names of parameters at a bound
    events : pairing changes that followed
    to_smallest_change : whether the step belongs to the way from the minimum to the smallest change
    long_step : whether it is a long step, taken since no short one reduced the objective
    modes : the paired modes there
    functions : the model's functions there, of each FRF residual
    merged : whether its events are pairs that alternated, and are compared as one subspace from there on
    better_minimum : where it is the end of the way to a better minimum than before, how that was found; "" otherwise
    """

    number: int
    objective: float
    mean_error: float
    x: Reals
    step: float
    damping: float
    at_bound: tuple[str, ...]
    events: tuple[str, ...] = ()
    to_smallest_change: bool = False
    long_step: bool = False
    modes: tuple[IterationMode, ...] = ()
    functions: tuple[FittedFrfs, ...] = field(default=(), repr=False)
    merged: bool = False
    better_minimum: str = ""


@dataclass(frozen=True)
class Certificate:
    """First-order conditions of a minimum inside the bounds, at the result.

    Slopes are of the objective, the steps of parameters measured in the smaller of their size and their prior standard
    deviation.

    Parameters
    ----------
    projected_gradient : largest |P(y − g) − y| with the parameters y and slopes g in these lengths, and P the
        projection on the bounds; zero at a minimum
    predicted_decrease : of the objective by a full Gauss-Newton step inside the bounds, relative to the objective
    multipliers : of the parameters at bounds, by name: the increase of the objective a unit length inwards. None is
        negative at a minimum
    """

    projected_gradient: float
    predicted_decrease: float
    multipliers: dict[str, float]


@dataclass(frozen=True)
class Trial:
    """Another pairing or start, and where it ended.

    Parameters
    ----------
    sentence : what was tried
    chi_square : at its end, over the comparisons of both ends; infinite where it was not solved
    before : χ² over the same comparisons of the best end until then
    iterations : that it took
    better : whether it became the result
    held : χ² where the update with another pairing ended while its pairs were held; None of a start, or without gain
    leads_back : whether a start was given up because its steps led back to the best end until then
    """

    kind: TrialKind
    sentence: str
    chi_square: float
    before: float
    iterations: int
    better: bool
    held: float | None = None
    leads_back: bool = False


@dataclass(frozen=True)
class MinimumSearch:
    """What was tried beyond an update.

    Parameters
    ----------
    reasons : why; none where nothing suggests another minimum, and nothing was tried
    first_chi_square : of the update as it had ended
    chi_square : over the same comparisons, of the result
    trials : in their order
    left : other pairings that were not tried, in words
    update_iterations : of the update itself
    """

    reasons: tuple[str, ...]
    first_chi_square: float
    chi_square: float
    trials: tuple[Trial, ...] = ()
    left: tuple[str, ...] = ()
    update_iterations: int = 0

    @property
    def improved(self) -> bool:
        """True if the result is a better minimum than that where the update had ended."""
        return any(trial.better for trial in self.trials)

    @property
    def iterations(self) -> int:
        """Of all trials."""
        return sum(trial.iterations for trial in self.trials)


@dataclass(frozen=True)
class UpdateResult:
    """Outcome of an update.

    `x` are normalised free parameters; `covariance` is of x; `active` are the names of the parameters that were moved;
    `side` is the side constraint as it was settled. `number` is that of the result in the history: the last one where
    the iteration ended at an optimum, otherwise the best one. `certificate` is None of several updates in turn.
    `smallest_change` is None if the result is a minimum inside the bounds. `minimum` is what was tried beyond the
    update; None where nothing was to be tried.
    """

    parameters: ParameterSet
    status: Status
    x: Reals
    before: Evaluation
    after: Evaluation
    history: tuple[Iteration, ...]
    covariance: ParameterCovariance
    citations: tuple[str, ...]
    active: tuple[str, ...]
    side: SideConstraint
    number: int
    certificate: Certificate | None = None
    smallest_change: SmallestChange | None = None
    minimum: MinimumSearch | None = None

    @property
    def objective(self) -> float:
        """½ rᵀr with the side constraint."""
        return self.history[self.number].objective

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of parameters at a bound."""
        return self.history[self.number].at_bound

    @property
    def values(self) -> dict[str, float]:
        """Updated values of all parameters, tied ones too."""
        return self.parameters.values(self.x)

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations of all parameters; NaN if none is given. Tied ones by linear propagation."""
        jets = self.parameters.jets(self.x)
        return {name: self.spread(jets[name].grad) for name in self.parameters.names}

    def interval(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Equal-tailed intervals of all parameters within their bounds; NaN where none is given.

        They are those of the linear model: normal, or of Student's t if the variance was estimated, and of the
        truncated distribution where a bound cuts off a part of it; see `BoxPosterior`.
        """
        none = (np.nan, np.nan)
        return {n: none if marginal is None else marginal.interval for n, marginal in self.marginals(level).items()}

    def marginals(self, level: float = 0.95) -> dict[str, Marginal | None]:
        """Mean, median and interval of all parameters, tied ones too; None if none is given."""
        jets = self.parameters.jets(self.x)
        return {
            name: self.marginal(jets[name], partial(self._at_samples, name), level) for name in self.parameters.names
        }

    def _at_samples(self, name: str, x: Reals) -> Reals:
        return self.parameters.at_samples(x)[name]

    def marginal(self, jet: Jet, values: Callable[[Reals], Reals], level: float = 0.95) -> Marginal | None:
        """The same for any quantity, from its value and derivatives at `x`, and its values at samples (n, k) of x."""
        posterior = self.covariance.posterior
        return None if posterior is None else posterior.of(jet, values, level)

    def spread(self, gradient: Reals) -> float:
        """Standard deviation of a quantity with this gradient in x, by linear propagation; NaN if none is given."""
        used = np.flatnonzero(gradient)
        return float(np.sqrt(gradient[used] @ self.covariance.matrix[np.ix_(used, used)] @ gradient[used]))

    @property
    def events(self) -> tuple[str, ...]:
        """All pairing changes."""
        return tuple(f"iteration {i.number}: {text}" for i in self.history for text in i.events)
