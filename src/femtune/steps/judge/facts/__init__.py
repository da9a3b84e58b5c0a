"""Topics of the verdict that need a computation of their own: from the fit to a record."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from femtune.steps.judge.facts.acceptance import acceptance
from femtune.steps.judge.facts.coverage import runs_coverage
from femtune.steps.judge.facts.linearity import linearity
from femtune.steps.judge.facts.missing import missing_fields
from femtune.steps.judge.facts.parts import parts_of_fit
from femtune.steps.judge.facts.scatter import frequency_scatter
from femtune.steps.judge.facts.usual import usual_ranges

if TYPE_CHECKING:
    from femtune.steps.judge.finished_update import FinishedUpdate
    from femtune.study.record import Record

FACTS: Mapping[str, Callable[[FinishedUpdate], Record | None]] = {
    "acceptance": lambda fit: acceptance(fit.study),
    "scatter": frequency_scatter,
    "usual_ranges": usual_ranges,
    "linearity": linearity,
    "missing": missing_fields,
    "parts": parts_of_fit,
    "coverage": runs_coverage,
}
"""By the field of `JudgementResults` that receives the record; None where the topic does not apply."""
