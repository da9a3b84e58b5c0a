"""Reasons from the computation itself: what was approximated, and whether the written deck is the solution."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.results import Results

_LARGEST_TRUNCATION_PERCENT = 1.0
"""Change of a level of a vibration test by its upper modes, in %, from which the test is a reservation: damping is
known to a few per cent at best, which changes levels by half of that."""


def computed_reasons(results: Results) -> Iterable[ReasonRecord]:
    """What was computed is not what is reported, or only an approximation of it."""
    yield from _deck_as_written(results)
    yield from _coverage(results)
    yield from _vibration(results)


def _deck_as_written(results: Results) -> Iterable[ReasonRecord]:
    written = results.write_back
    if written is not None and written.differences:
        yield reason("not accepted", "judge.deck-differs", difference=written.differences[0])


def _coverage(results: Results) -> Iterable[ReasonRecord]:
    coverage = None if results.judgement is None else results.judgement.coverage
    if coverage is None:
        return
    for one in coverage.outside:
        side = "below" if one.value < one.low else "above"
        facts = {"parameter": one.parameter, "value": one.value, "side": side, "low": one.low, "high": one.high}
        yield reason("not accepted", "judge.outside-runs", one.parameter, **facts)
    sd = coverage.frequency_sd_percent
    if sd is not None and sd > coverage.limit_percent and not coverage.outside:
        yield reason("reservation", "judge.between-runs", mode=coverage.mode, percent=sd, limit=coverage.limit_percent)


def _vibration(results: Results) -> Iterable[ReasonRecord]:
    for test in () if results.validation is None else results.validation.vibrations:
        if test.modes_to_hz is None or test.highest_hz is None or test.truncation_percent is None:
            continue
        facts = {"test": test.name, "last_hz": test.modes_to_hz, "highest_hz": test.highest_hz}
        if not test.chosen_modes and test.modes_to_hz < test.highest_hz:
            yield reason("reservation", "judge.too-few-modes", test.configuration, **facts)
        elif test.truncation_percent > _LARGEST_TRUNCATION_PERCENT:
            change = test.truncation_percent
            yield reason("reservation", "judge.truncated", test.configuration, percent=change, **facts)
