"""Records of derived quantities: values at the start and after the update, with standard deviations."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from femtune.errors import FemtuneError
from femtune.parameters import DerivedQuantity, Jet, ParameterSet
from femtune.study.derived import quantities
from femtune.study.load import Study
from femtune.study.results_update import DerivedResult
from femtune.update import UpdateResult

_NO_VALUE = "its expression has no finite value at the updated parameters"


def derived_results(study: Study, result: UpdateResult) -> Iterable[DerivedResult]:
    """The derived quantities of a study after an update; an expression without a value there says so."""
    for quantity in quantities(study.file):
        before, after = (_known(quantity, result.parameters, x) for x in (np.zeros(len(result.x)), result.x))
        sd = np.nan if after is None else result.spread(after.grad)
        yield DerivedResult(
            name=quantity.name,
            expression=quantity.expression.text,
            unit=quantity.unit,
            nominal=None if before is None else float(before.value),
            value=None if after is None else float(after.value),
            sd=float(sd) if np.isfinite(sd) else None,
            sd_reason="" if np.isfinite(sd) else _reason(result, after),
        )


def _known(quantity: DerivedQuantity, parameters: ParameterSet, x: np.ndarray) -> Jet | None:
    try:
        return quantity.at(parameters, x)
    except FemtuneError:
        return None


def _reason(result: UpdateResult, after: Jet | None) -> str:
    if after is None:
        return _NO_VALUE
    names = [p.name for p in result.parameters.free]
    found = (int(i) for i in np.flatnonzero(after.grad) if int(i) in result.covariance.reasons)
    return "; ".join(f"{names[i]}: {result.covariance.reasons[i]}" for i in found) or "σ not given"
