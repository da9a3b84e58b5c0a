"""Records of the weight that was found and of many starts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from femtune.parameters import ParameterSet
from femtune.study.results_search import OptimumFacts, PathPoint, StartFacts, StartsResults, WeightChoiceResults
from femtune.update import MultiStart, UpdateResult, WeightChoice


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
