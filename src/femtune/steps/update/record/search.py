"""The search as records: choice of the regularisation weight, and the starts."""

from __future__ import annotations

from femtune.study.record import Record
from femtune.updating.kinds import TrialKind, WeightRule


class PathPoint(Record):
    """Solution of the linear model of the first iteration for one weight of the side constraint."""

    weight: float
    """The weight (no unit)."""
    residual_norm: float
    """Norm of the residuals in their standard deviations (no unit)."""
    constraint_norm: float
    """Norm of the side constraint without its weight (no unit)."""
    curvature: float | None
    """Curvature of the L-curve (no unit); None where it is not defined."""
    cross_validation: float | None
    """Generalised cross-validation (no unit); None if there are no more residuals than parameters."""
    parameters: tuple[float, ...]
    """Values of the free parameters, without bounds, each in its unit, as UpdateResults.history_parameters."""


class WeightChoiceResults(Record):
    """Choice of the regularisation weight."""

    rule: WeightRule
    """The rule."""
    status: str
    """Name of the status: "CORNER"."""
    found: bool
    """False if no weight could be determined, and the update ran without the constraint."""
    sentence: str
    """The outcome, in a sentence."""
    weight: float | None
    """The weight (no unit); None if none was found."""
    path: tuple[PathPoint, ...]
    """The path, with increasing weights."""


class StartFacts(Record):
    """One start of a multi-start update."""

    number: int
    """Its number, from 1."""
    start: tuple[float, ...]
    """Initial values of the free parameters, each in its unit, as UpdateResults.history_parameters."""
    end: tuple[float, ...]
    """Final values."""
    objective: float | None
    """Half the sum of squared residuals at the end, side constraint included (no unit); None if it failed."""
    outcome: str
    """Name of the outcome: "BEST"."""
    sentence: str
    """The outcome in words, with the reason of a failure."""
    tries: int
    """Number of runs from this start."""
    iterations: int
    """Number of iterations of all runs."""


class OptimumFacts(Record):
    """Starts that reached the same point."""

    objective: float
    """Half the sum of squared residuals, side constraint included (no unit)."""
    parameters: tuple[float, ...]
    """Free parameters there, each in its unit, as UpdateResults.history_parameters."""
    starts: tuple[int, ...]
    """Numbers of the starts that ended there."""
    as_good: bool
    """True if it is equally good as the best within the noise."""


class StartsResults(Record):
    """A multi-start update."""

    seed: int
    """Of the Latin hypercube."""
    samples: int = 0
    """Points of the Latin hypercube at which the objective was evaluated to choose the starts; 0: the points are
    the starts."""
    unsolved_samples: int = 0
    """Those of them at which the model could not be solved."""
    unique: bool
    """False if another optimum is equally good within the noise."""
    sentences: tuple[str, ...]
    """Summary of the starts, in sentences."""
    noise: float
    """Difference of the objectives below which points are equally good within the noise (no unit)."""
    starts: tuple[StartFacts, ...]
    """In the order of their numbers."""
    optima: tuple[OptimumFacts, ...]
    """Distinct ends, the best first."""


class TrialFacts(Record):
    """Another pairing or start that was tried at the end of the update."""

    kind: TrialKind
    """"pairing": test modes with other partners, from the end of the update; "start": other initial values."""
    sentence: str
    """What was tried: the pairs, or the number of the start."""
    chi_square: float | None
    """Sum of squares at its end, side constraint included (no unit); None if it could not be solved. Test modes without
    a partner at one of both ends are compared with the nearest model mode there."""
    before: float
    """The same over the same comparisons, at the best end until then."""
    iterations: int
    """Iterations that it took."""
    better: bool
    """True if it became the result."""
    held: float | None = None
    """Sum of squares where the update with another pairing ended while its pairs were held; None of a start, or if it
    was not lower."""
    leads_back: bool = False
    """True of a start that was given up because its steps led back to the best end until then."""


class MinimumResults(Record):
    """What was tried at the end of the update to find a better minimum."""

    reasons: tuple[str, ...]
    """What suggested another minimum; empty if nothing did, so that nothing was tried."""
    first_chi_square: float
    """Sum of squares where the update itself ended (no unit)."""
    chi_square: float
    """The same over the same comparisons, at the result."""
    improved: bool
    """True if the result is a better minimum than that where the update itself ended."""
    trials: tuple[TrialFacts, ...] = ()
    """Other pairings and starts, in the order in which they were tried."""
    left: tuple[str, ...] = ()
    """Other pairings that are possible and were not tried."""
    iterations: int = 0
    """Iterations of all trials."""
    update_iterations: int = 0
    """Iterations of the update itself."""


class BoundMultiplier(Record):
    """Lagrange multiplier of a parameter at a bound."""

    parameter: str
    """The parameter."""
    value: float
    """Increase of half the sum of squares per unit of its step length inwards; not negative at a minimum."""


class CertificateResults(Record):
    """First-order conditions of a minimum within the bounds, at the result.

    The step length of a parameter is the smaller of its size and its prior standard deviation.
    """

    projected_gradient: float
    """Largest entry of the projected gradient of half the sum of squares, per step length (no unit)."""
    predicted_decrease: float
    """Decrease of half the sum of squares by a full Gauss-Newton step within the bounds, relative to it (no unit)."""
    multipliers: tuple[BoundMultiplier, ...]
    """Of the parameters at bounds."""


class SmallestChangeResults(Record):
    """The smallest change within a margin of the minimum of χ²: the result where combinations are undetermined."""

    chi_square: float
    """Sum of squares at the minimum within the bounds, side constraint included (no unit)."""
    allowed: float
    """Allowed increase of it (no unit)."""
    increase: float
    """Increase of it at the result (no unit)."""
    weight: float
    """Weight μ of the squared change in prior standard deviations (no unit)."""
    size: float
    """Length of the change from the nominal values at the result, in prior standard deviations."""
    optimum_size: float
    """The same at the minimum within the bounds."""
    optimum: tuple[float, ...]
    """Free parameters at the minimum within the bounds, each in its unit, as UpdateResults.history_parameters."""
    optimum_at_bound: tuple[str, ...]
    """Parameters that are at a bound there."""
