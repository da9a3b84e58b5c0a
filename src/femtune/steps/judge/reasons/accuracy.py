"""Reasons from the frequency errors that are left, beside the repeatability of the test and the error of the mesh."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from femtune.document.numbers import short, signed_percent
from femtune.steps.judge.record.reason import ReasonRecord, reason

if TYPE_CHECKING:
    from femtune.steps.results import Results

_SCATTER = 2.0
"""Frequency error over the scatter of the test above which the test does not explain it: two standard deviations."""
_OF_LIMIT = 0.5
"""Share of the allowed frequency error above which errors that the test does not explain are not accepted: a
judgement."""
_MESH = "mesh"


def accuracy_reasons(results: Results) -> Iterable[ReasonRecord]:
    """Frequency errors above the scatter of the test, and errors of the mesh above the frequency errors."""
    scatter = results.judgement and results.judgement.scatter
    if scatter and scatter.error_percent > _SCATTER * scatter.test_percent:
        large = scatter.limit_percent is not None and scatter.error_percent > _OF_LIMIT * scatter.limit_percent
        yield reason(
            "not accepted" if large else "reservation", "judge.scatter",
            error=short(scatter.error_percent), test=short(scatter.test_percent), pairs=scatter.pairs,
        )  # fmt: skip
    stages = [c.stage for c in results.correlations]
    for c in results.correlations:
        if c.stage != stages[-1] or not c.pairs:
            continue
        error = (sum(p.freq_error_percent**2 for p in c.pairs) / len(c.pairs)) ** 0.5
        for check in results.model_checks:
            if (check.check, check.configuration, check.verdict) != (_MESH, c.configuration, "pass"):
                continue
            # a check that fails has an alert
            if check.measured is not None and abs(check.measured) > error:
                yield reason(
                    "reservation", "judge.mesh", c.configuration,
                    mesh=signed_percent(check.measured), error=short(error),
                )  # fmt: skip
