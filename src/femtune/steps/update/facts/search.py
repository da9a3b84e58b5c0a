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
    MinimumResults,
    OptimumFacts,
    PathPoint,
    SmallestChangeResults,
    StartFacts,
    StartsResults,
    TrialFacts,
    WeightChoiceResults,
)


def certificate_results(result: UpdateResult) -> CertificateResults | None:
    """The certificate; None of several updates in turn."""
    certificate = result.certificate
    if certificate is None:
        return None
    return CertificateResults(
        projected_gradient=certificate.projected_gradient,
        predicted_decrease=certificate.predicted_decrease,
        multipliers=tuple(BoundMultiplier(parameter=n, value=v) for n, v in certificate.multipliers.items()),
    )


def smallest_change_results(result: UpdateResult) -> SmallestChangeResults | None:
    """The smallest change; None where the result is the minimum within the bounds."""
    change = result.smallest_change
    if change is None:
        return None
    return SmallestChangeResults(
        chi_square=change.chi_square,
        allowed=change.allowed,
        increase=change.increase,
        weight=change.weight,
        size=change.size,
        optimum_size=change.optimum_size,
        optimum=_values(result.parameters, change.optimum),
        optimum_at_bound=change.optimum_at_bound,
    )


def minimum_results(result: UpdateResult) -> MinimumResults | None:
    """What was tried for a better minimum; None where nothing was to be tried."""
    minimum = result.minimum
    if minimum is None:
        return None
    return MinimumResults(
        reasons=minimum.reasons,
        first_chi_square=minimum.first_chi_square,
        chi_square=minimum.chi_square,
        improved=minimum.improved,
        trials=tuple(
            TrialFacts(
                kind=t.kind, sentence=t.sentence, chi_square=_finite(t.chi_square), before=t.before,
                iterations=t.iterations, better=t.better, held=t.held, leads_back=t.leads_back,
            )
            for t in minimum.trials
        ),
        left=minimum.left,
        iterations=minimum.iterations,
        update_iterations=minimum.update_iterations,
    )  # fmt: skip


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


def starts_results(multi_start: MultiStart, seed: int) -> StartsResults:
    """All starts as a record."""
    outcomes, parameters = multi_start.outcomes, multi_start.parameters
    return StartsResults(
        seed=seed,
        samples=len(multi_start.samples),
        unsolved_samples=sum(not np.isfinite(s.objective) for s in multi_start.samples),
        unique=multi_start.unique,
        sentences=multi_start.sentences,
        noise=multi_start.noise,
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
            for s in multi_start.starts
        ),
        optima=tuple(
            OptimumFacts(
                objective=o.objective, parameters=_values(parameters, o.x), starts=o.members, as_good=o.as_good
            )
            for o in multi_start.optima
        ),
    )


def _values(parameters: ParameterSet, x: NDArray[np.float64]) -> tuple[float, ...]:
    return tuple(float(v) for v in parameters.denormalise(x))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
