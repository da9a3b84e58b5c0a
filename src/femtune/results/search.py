"""The search as records: how the weight of the regularisation was found, and the starts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from femtune.results.base import Record

if TYPE_CHECKING:
    from femtune.parameters import ParameterSet
    from femtune.updating import MultiStart, UpdateResult, WeightChoice


class PathPoint(Record):
    """What the linear model of the first iteration gives for one weight of the side constraint."""

    weight: float
    """The weight (no unit)."""
    residual_norm: float
    """Norm of the residuals in their standard deviations (no unit)."""
    constraint_norm: float
    """Norm of the side constraint without its weight (no unit)."""
    curvature: float | None
    """Of the L-curve (no unit); None where it stands still."""
    cross_validation: float | None
    """Generalised cross-validation (no unit); None without residuals to spare."""
    parameters: tuple[float, ...]
    """Values of the free parameters, bounds left aside, each in its unit, as UpdateResults.history_parameters."""


class WeightChoiceResults(Record):
    """How the weight of the regularisation was found."""

    rule: Literal["l-curve", "gcv"]
    """The rule."""
    status: str
    """Name of the status: "CORNER"."""
    found: bool
    """False where there was no weight to find, and the update ran without the constraint."""
    sentence: str
    """What happened, in a sentence."""
    weight: float | None
    """The weight (no unit); None where none was found."""
    path: tuple[PathPoint, ...]
    """The whole path, weights rising."""


class StartFacts(Record):
    """One start of many."""

    number: int
    """Its number, from 1."""
    start: tuple[float, ...]
    """Free parameters where it set out, each in its unit, as UpdateResults.history_parameters."""
    end: tuple[float, ...]
    """Where it ended."""
    objective: float | None
    """Half the sum of squared residuals at the end, side constraint included (no unit); None where it failed."""
    outcome: str
    """Name of what became of it: "BEST"."""
    sentence: str
    """The same in words, with the reason where it failed."""
    tries: int
    """How many times it set out."""
    iterations: int
    """Of all tries."""


class OptimumFacts(Record):
    """Ends that are one point."""

    objective: float
    """Half the sum of squared residuals, side constraint included (no unit)."""
    parameters: tuple[float, ...]
    """Free parameters there, each in its unit, as UpdateResults.history_parameters."""
    starts: tuple[int, ...]
    """Numbers of the starts that ended there."""
    as_good: bool
    """True where the data cannot tell it from the best."""


class StartsResults(Record):
    """Many starts, each kept."""

    seed: int
    """Of the Latin hypercube."""
    unique: bool
    """False where another optimum is as good within the noise."""
    sentences: tuple[str, ...]
    """What the starts tell of the answer."""
    noise: float
    """By how much objectives may differ for the data not to tell their points apart (no unit)."""
    starts: tuple[StartFacts, ...]
    """In the order of their numbers."""
    optima: tuple[OptimumFacts, ...]
    """Distinct ends, the best first."""


# ----------------------------------------------------------------------------------------------------
# How the records are made.


def weight_choice_results(result: UpdateResult) -> WeightChoiceResults | None:
    """How the weight was found; None where it was given."""
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
