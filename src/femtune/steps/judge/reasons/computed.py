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
_REPEATABILITY_PERCENT = 0.1
"""Scatter of the frequencies of repeated modal tests, in %: a smaller error of the mesh does not matter."""


def computed_reasons(results: Results) -> Iterable[ReasonRecord]:
    """What was computed is not what is reported, or only an approximation of it."""
    yield from _deck_as_written(results)
    yield from _coverage(results)
    yield from _vibration(results)
    yield from _mesh(results)
    yield from _reduced_model(results)
    yield from _truncated_frfs(results)


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


def _vibration(results: Results) -> Iterable[ReasonRecord]:
    for test in () if results.validation is None else results.validation.vibrations:
        if test.modes_to_hz is None or test.highest_hz is None or test.truncation_percent is None:
            continue
        facts = {"test": test.name, "last_hz": test.modes_to_hz, "highest_hz": test.highest_hz}
        if not test.all_modes and test.modes_to_hz < test.highest_hz:
            yield reason("reservation", "judge.too-few-modes", test.configuration, **facts)
        elif test.truncation_percent > _LARGEST_TRUNCATION_PERCENT:
            change = test.truncation_percent
            yield reason("reservation", "judge.truncated", test.configuration, percent=change, **facts)


def _mesh(results: Results) -> Iterable[ReasonRecord]:
    """The error due to the mesh is beyond its limit, or beyond the scatter of the frequencies."""
    scatter = _frequency_scatter(results)
    for check in results.model_checks:
        if check.check != "mesh" or check.measured is None:
            continue
        size, facts = abs(check.measured), {"error": check.measured, "configuration": check.configuration}
        if size > check.limit:
            yield reason("not accepted", "judge.mesh", check.configuration, limit=check.limit, **facts)
        elif scatter is not None and size > max(scatter, _REPEATABILITY_PERCENT):
            yield reason("reservation", "judge.mesh/above-scatter", check.configuration, scatter=scatter, **facts)


def _frequency_scatter(results: Results) -> float | None:
    """Root mean square error of the frequencies of the paired modes at the end, in %."""
    last = [c for c in results.correlations if c.stage == results.correlations[-1].stage]
    errors = [p.freq_error_percent for c in last for p in c.pairs]
    return (sum(e * e for e in errors) / len(errors)) ** 0.5 if errors else None


def _reduced_model(results: Results) -> Iterable[ReasonRecord]:
    reduction = None if results.update is None else results.update.reduction
    if reduction is not None and not reduction.certified:
        yield reason("not accepted", "judge.not-certified", last_round=reduction.rounds[-1])
    if reduction is not None and reduction.frfs is not None and not reduction.frfs.compared:
        yield reason("reservation", "judge.not-certified/nothing-compared")


def _truncated_frfs(results: Results) -> Iterable[ReasonRecord]:
    for found in () if results.update is None else results.update.frf_truncation:
        if not found.small and found.stage == "after":
            yield reason("reservation", "judge.frfs-truncated", found.configuration, outcome=found.sentence)
