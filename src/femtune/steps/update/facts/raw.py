"""The record of the update with measured FRFs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from femtune.steps.update.record.raw import RawResults, RawValue

if TYPE_CHECKING:
    from femtune.steps.update.raw import RawUpdate
    from femtune.updating import UpdateResult


def raw_results(raw: RawUpdate | None, result: UpdateResult) -> RawResults | None:
    """The record; None without such an update.

    Parameters
    ----------
    result : as it is reported
    """
    if raw is None:
        return None
    before, after, sd = raw.equalised.values, result.values, raw.equalised.sd
    mapped = tuple(raw.damping.values())
    first = mapped[0]
    known = [first.ratios[model] for _, model in first.partners]
    return RawResults(
        values=tuple(_value(p.name, before[p.name], after[p.name], sd[p.name]) for p in result.parameters.free),
        iterations=len(raw.equalised.history),
        paired=sum(len(one.partners) for one in mapped),
        others_percent=100.0 * float(np.median(known)),
    )


def _value(name: str, before: float, after: float, sd: float) -> RawValue:
    known = bool(np.isfinite(sd)) and sd > 0.0
    return RawValue(
        parameter=name, equalised=before, equalised_sd=sd if known else None,
        moved=(after - before) / sd if known else None,
    )  # fmt: skip
