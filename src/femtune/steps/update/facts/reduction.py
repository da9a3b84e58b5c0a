"""The reduced model of an update, as records."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from femtune.updating import FrfAgreement, ReducedUpdate, ReductionRules
from femtune.steps.update.record.reduction import (
    ReducedComponentResults,
    ReducedFrfResults,
    ReducedModelResults,
    ReductionResults,
)


def reduction_results(reduced: ReducedUpdate, rules: ReductionRules) -> ReductionResults:
    """How the reduced models did."""
    models = tuple(
        ReducedModelResults(
            configuration=c.configuration,
            order=c.order,
            full_solutions=c.full_solutions,
            estimate_percent=100.0 * c.estimate,
            certified_error_percent=100.0 * c.certified_error,
            training=c.status.value,
            interface_dofs=c.interface_dofs,
            truncation_percent=100.0 * c.truncation if c.components else None,
            components=tuple(
                ReducedComponentResults(
                    name=p.name,
                    dofs=p.dofs,
                    interface_dofs=p.interface_dofs,
                    max_hz=p.max_hz,
                    modes=p.modes,
                    coordinates=p.vectors,
                    builds=p.builds,
                )
                for p in c.components
            ),
            frf_residuals=c.functions,
        )
        for c in reduced.cases
    )
    return ReductionResults(
        tolerance_percent=100.0 * rules.tolerance, certified=reduced.certified, models=models, rounds=reduced.rounds,
        frfs=_frfs(reduced.functions, rules),
    )  # fmt: skip


def _frfs(agreement: FrfAgreement | None, rules: ReductionRules) -> ReducedFrfResults | None:
    if agreement is None:
        return None
    return ReducedFrfResults(
        mean_difference=agreement.mean,
        largest_difference=agreement.largest,
        shift=agreement.shift,
        tolerance=rules.frf_tolerance,
        compared=agreement.compared,
    )
