"""The search as records: choice of the regularisation weight, and the starts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune.results.base import Record
from femtune.updating.kinds import WeightRule

if TYPE_CHECKING:
    from femtune.parameters import ParameterSet
    from femtune.updating import MultiStart, UpdateResult, WeightChoice


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


# ----------------------------------------------------------------------------------------------------
# How the records are made.


def certificate_results(result: UpdateResult) -> CertificateResults | None:
    """The certificate; None of several updates in turn."""
    found = result.certificate
    if found is None:
        return None
    return CertificateResults(
        projected_gradient=found.projected_gradient,
        predicted_decrease=found.predicted_decrease,
        multipliers=tuple(BoundMultiplier(parameter=n, value=v) for n, v in found.multipliers.items()),
    )


def smallest_change_results(result: UpdateResult) -> SmallestChangeResults | None:
    """The smallest change; None where the result is the minimum within the bounds."""
    found = result.smallest_change
    if found is None:
        return None
    return SmallestChangeResults(
        chi_square=found.chi_square,
        allowed=found.allowed,
        increase=found.increase,
        weight=found.weight,
        size=found.size,
        optimum_size=found.optimum_size,
        optimum=_values(result.parameters, found.optimum),
        optimum_at_bound=found.optimum_at_bound,
    )


def weight_choice_results(result: UpdateResult) -> WeightChoiceResults | None:
    """Choice of the weight; None if it was given."""
    choice = result.side.choice
    if choice is None:
        return None
    return WeightChoiceResults(
        rule="gcv" if choice.rule == "gcv" else "l-curve",
        status=choice.status.name,
        found=choice.status.found,
        sentence=choice.status.value,
        weight=choice.weight if choice.status.found else None,
        path=tuple(_path(choice, result.parameters, result.before.x)),
    )


def _path(choice: WeightChoice, parameters: ParameterSet, x: NDArray[np.float64]) -> Iterator[PathPoint]:
    path = choice.path
    for i in range(len(path.weights)):
        yield PathPoint(
            weight=float(path.weights[i]),
            residual_norm=float(path.residual_norms[i]),
            constraint_norm=float(path.constraint_norms[i]),
            curvature=_finite(path.curvature[i]),
            cross_validation=_finite(path.cross_validation[i]),
            parameters=_values(parameters, x + path.changes[i]),
        )


def starts_results(found: MultiStart, seed: int) -> StartsResults:
    """All starts as a record."""
    outcomes, parameters = found.outcomes, found.parameters
    return StartsResults(
        seed=seed,
        samples=len(found.samples),
        unsolved_samples=sum(not np.isfinite(s.objective) for s in found.samples),
        unique=found.unique,
        sentences=found.sentences,
        noise=found.noise,
        starts=tuple(
            StartFacts(
                number=s.number,
                start=_values(parameters, s.start),
                end=_values(parameters, s.end),
                objective=_finite(s.objective),
                outcome=outcomes[s.number].name,
                sentence=f"{outcomes[s.number].value}: {s.problem}" if s.problem else outcomes[s.number].value,
                tries=s.tries,
                iterations=s.iterations,
            )
            for s in found.starts
        ),
        optima=tuple(
            OptimumFacts(
                objective=o.objective, parameters=_values(parameters, o.x), starts=o.members, as_good=o.as_good
            )
            for o in found.optima
        ),
    )


def _values(parameters: ParameterSet, x: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(v) for v in parameters.denormalise(x))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
