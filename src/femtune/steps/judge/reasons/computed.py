"""Reasons from the computation itself: what was approximated, and whether the written deck is the solution."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.results import Results


def computed_reasons(results: Results) -> Iterable[ReasonRecord]:
    """What was computed is not what is reported, or only an approximation of it."""
    yield from _deck_as_written(results)
    yield from _coverage(results)


def _deck_as_written(results: Results) -> Iterable[ReasonRecord]:
    written = results.write_back
    if written is not None and written.differences:
        yield reason("not accepted", "judge.deck-differs", difference=written.differences[0])


def _coverage(results: Results) -> Iterable[ReasonRecord]:
    found = None if results.judgement is None else results.judgement.coverage
    if found is None:
        return
    for one in found.outside:
        side = "below" if one.value < one.low else "above"
        facts = {"parameter": one.parameter, "value": one.value, "side": side, "low": one.low, "high": one.high}
        yield reason("not accepted", "judge.outside-runs", one.parameter, **facts)
    sd = found.frequency_sd_percent
    if sd is not None and sd > found.limit_percent and not found.outside:
        yield reason("reservation", "judge.between-runs", mode=found.mode, percent=sd, limit=found.limit_percent)
