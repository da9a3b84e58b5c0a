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


def _deck_as_written(results: Results) -> Iterable[ReasonRecord]:
    written = results.write_back
    if written is not None and written.differences:
        yield reason("not accepted", "judge.deck-differs", difference=written.differences[0])
