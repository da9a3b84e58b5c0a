"""The records of a bootstrap, from its resampled updates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.steps.update.facts.update import citations

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.uncertainty import BootstrapParameter, BootstrapResult
from femtune.steps.bootstrap.record import BootstrappedParameter, BootstrapResults


def bootstrap_results(
    result: BootstrapResult,
    arrays: dict[str, NDArray[Any]],
    executor: str,
    seconds: float,
    recalled: int,
    remarks: Sequence[Notice] = (),
    reduced_orders: tuple[int, ...] = (),
) -> BootstrapResults:
    """The record of all runs; samples and correlation are put into `arrays`."""
    keys = {name: f"bootstrap/{name}" for name in ("samples", "correlation")}
    arrays[keys["samples"]] = np.asarray(result.parameters.denormalise(result.samples))
    arrays[keys["correlation"]] = result.correlation
    return BootstrapResults(
        method=result.rules.method,
        runs=len(result.runs),
        converged=len(result.samples),
        seed=result.rules.seed,
        drawn_from=result.groups,
        identified=result.identified,
        jacobian=result.rules.jacobian,
        own_jacobian=sum(r.own for r in result.runs),
        largest_difference=result.difference,
        checked=len(result.check),
        solutions=result.solutions,
        recalled=recalled,
        seconds=seconds,
        executor=executor,
        parameters=tuple(_parameter(p) for p in result.found),
        free=tuple(p.name for p in result.parameters.free),
        samples_key=keys["samples"],
        correlation_key=keys["correlation"],
        sentences=(*result.sentences, *_models(reduced_orders)),
        reduced_orders=reduced_orders,
        remarks=tuple(n.what for n in remarks),
        citations=citations(("efron1993", "hesterberg2015", *(["wu1986"] if result.identified else []))),
    )


def _models(orders: tuple[int, ...]) -> tuple[str, ...]:
    if not orders:
        return ()
    one, several = f"a reduced model of order {orders[0]}", f"reduced models of orders up to {max(orders)}"
    return (
        f"The runs were made on {one if len(orders) == 1 else several}, whose basis contains the full model's modes "
        "and static responses at the result of the update.",
    )


def _parameter(p: BootstrapParameter) -> BootstrappedParameter:
    return BootstrappedParameter(
        parameter=p.name,
        value=p.value,
        mean=p.mean,
        sd=p.sd,
        cov_percent=100.0 * p.cov if np.isfinite(p.cov) else None,
        bias=p.bias,
        linear_sd=p.linear_sd,
        fisher_sd=p.fisher_sd,
        fisher_cov_percent=100.0 * p.fisher_sd / abs(p.value) if p.value else None,
        interval_95=(p.lower, p.upper),
        at_bound_percent=100.0 * p.at_bound,
    )
