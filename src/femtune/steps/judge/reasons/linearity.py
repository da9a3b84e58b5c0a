"""The reason that standard deviations and intervals are those of a linear model that does not hold."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.results import Results

_LOWER = 1.0
"""Decrease of χ² along an axis from which another minimum is near."""


def linearity_reasons(results: Results) -> Iterable[ReasonRecord]:
    """χ² lower than at the result, or a curved valley."""
    linearity = None if results.judgement is None else results.judgement.linearity
    if linearity is None:
        return
    solved = [p for p in linearity.points if p.true is not None]
    lower = min(solved, key=lambda p: p.true or 0.0, default=None)
    if lower is not None and lower.true is not None and lower.true < -_LOWER:
        yield reason("not accepted", "judge.lower-beside", axis=lower.axis, step=abs(lower.step), decrease=-lower.true)
        return
    curved = [p for p in linearity.points if p.curved]
    if curved:
        worst = max(curved, key=lambda p: float("inf") if p.true is None else abs(p.true - p.linear))
        code = "judge.curved/unsolved" if worst.true is None else "judge.curved"
        yield reason(
            "reservation", code, axis=worst.axis, step=abs(worst.step), linear=worst.linear, true=worst.true or 0.0,
            count=len(curved), of=len(linearity.points),
        )  # fmt: skip
