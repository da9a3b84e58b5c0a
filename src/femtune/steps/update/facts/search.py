"""The path of the search, its starts and its certificate, as records."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from femtune.parameters import ParameterSet
    from femtune.updating import MultiStart, UpdateResult, WeightChoice
from femtune.steps.update.record.search import (
    BoundMultiplier,
    CertificateResults,
    OptimumFacts,
    PathPoint,
    SmallestChangeResults,
    StartFacts,
    StartsResults,
    WeightChoiceResults,
)


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
