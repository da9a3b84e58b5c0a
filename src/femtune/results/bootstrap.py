"""The bootstrap as a record: distribution of the parameters from the FRFs of one test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from femtune.identification.kinds import Drawing
from femtune.results.base import CitationRecord, Record
from femtune.results.update import citations
from femtune.uncertainty.kinds import Jacobian

if TYPE_CHECKING:
    from femtune.errors import Notice
    from femtune.uncertainty import BootstrapParameter, BootstrapResult


class BootstrappedParameter(Record):
    """One parameter over the bootstrap runs, in its unit."""

    parameter: str
    """Name of the parameter."""
    value: float
    """Result of the update, from all data."""
    mean: float
    """Mean of the runs."""
    sd: float
    """Standard deviation of the runs."""
    cov_percent: float | None
    """Coefficient of variation: standard deviation over the mean of the parameter itself, in %; None for a mean of
    zero."""
    bias: float
    """Mean of the runs less the result of the update, in standard deviations of the runs (no unit)."""
    linear_sd: float
    """Standard deviation of the runs by linearisation: that of the first Gauss-Newton steps."""
    fisher_sd: float
    """Standard deviation by the inverse Fisher information at the result, from the stated standard deviations."""
    fisher_cov_percent: float | None
    """That one over the result of the update, in %."""
    interval_95: tuple[float, float]
    """95 % interval from percentiles of the runs, widened for the number of frequency lines."""
    at_bound_percent: float
    """Part of the runs that ended at a bound of the parameter, in %."""


class BootstrapResults(Record):
    """Bootstrap about the result of the update."""

    method: Drawing
    """What is drawn: frequency lines, single FRF values, or noise of the stated standard deviations."""
    runs: int
    """Number of runs."""
    converged: int
    """Number of runs that converged; the others are left out."""
    seed: int
    """Seed of the random numbers."""
    drawn_from: int
    """Number of frequency lines or values that are drawn from; of residuals for noise."""
    identified: bool = False
    """Whether what is drawn are the measured FRFs behind those of an identified test, which are compared."""
    jacobian: Jacobian
    """Derivatives of the steps: those at the result of the update, or those of each point."""
    own_jacobian: int
    """Number of runs that needed derivatives at other points."""
    largest_difference: float | None
    """Largest difference between runs with shared and with own derivatives, in standard deviations; None if not
    checked."""
    checked: int
    """Number of runs that were made with both."""
    solutions: int
    """Number of points at which the model was solved, in all runs."""
    recalled: int
    """Number of runs from the journal of an earlier run."""
    seconds: float
    """Duration, s."""
    executor: str
    """Where the runs were made."""
    parameters: tuple[BootstrappedParameter, ...]
    """All parameters, tied ones too."""
    free: tuple[str, ...]
    """Names of the free parameters, the columns of samples and correlation."""
    samples_key: str
    """Key of the values of the free parameters in the runs, shape (converged, free), each in its unit."""
    correlation_key: str
    """Key of their correlation, shape (free, free)."""
    sentences: tuple[str, ...]
    """What the runs show, in sentences."""
    reduced_orders: tuple[int, ...] = ()
    """Orders of the reduced models on which the runs were made, one per configuration; none if they were made on the
    full model."""
    remarks: tuple[str, ...] = ()
    """Worker processes that were replaced."""
    citations: tuple[CitationRecord, ...] = ()
    """Publications on the method."""


def bootstrap_results(
    found: BootstrapResult,
    arrays: dict[str, NDArray[Any]],
    executor: str,
    seconds: float,
    recalled: int,
    remarks: Sequence[Notice] = (),
    reduced_orders: tuple[int, ...] = (),
) -> BootstrapResults:
    """The record of all runs; samples and correlation are put into `arrays`."""
    keys = {name: f"bootstrap/{name}" for name in ("samples", "correlation")}
    arrays[keys["samples"]] = np.asarray(found.parameters.denormalise(found.samples))
    arrays[keys["correlation"]] = found.correlation
    return BootstrapResults(
        method=found.rules.method,
        runs=len(found.runs),
        converged=len(found.samples),
        seed=found.rules.seed,
        drawn_from=found.groups,
        identified=found.identified,
        jacobian=found.rules.jacobian,
        own_jacobian=sum(r.own for r in found.runs),
        largest_difference=found.difference,
        checked=len(found.check),
        solutions=found.solutions,
        recalled=recalled,
        seconds=seconds,
        executor=executor,
        parameters=tuple(_parameter(p) for p in found.found),
        free=tuple(p.name for p in found.parameters.free),
        samples_key=keys["samples"],
        correlation_key=keys["correlation"],
        sentences=(*found.sentences, *_models(reduced_orders)),
        reduced_orders=reduced_orders,
        remarks=tuple(n.what for n in remarks),
        citations=citations(("efron1993", "hesterberg2015", *(["wu1986"] if found.identified else []))),
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
