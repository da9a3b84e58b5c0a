"""Reduced models that an update searched on: their order, what they cost and how right they are."""

from __future__ import annotations

from femtune.report.document import Block, Listing, Paragraph, Table, columns, row
from femtune.report.numbers import short
from femtune.study.results_reduction import ReductionResults

_COST = (
    "Full solutions: for the training, and where each search ended. Those of the comparison before the update and of "
    "what was written, and the derivatives at the end, come on top."
)


def reduced_models(reduction: ReductionResults | None) -> list[Block]:
    """A table of the models, and what was found each time the search ended; nothing without reduced models."""
    if reduction is None:
        return []
    heads = columns("Configuration", ">Order", ">Full solutions", ">Estimate %", ">Certified error %", "Training")
    rows = [
        row(
            m.configuration,
            str(m.order),
            str(m.full_solutions),
            short(m.estimate_percent),
            short(m.certified_error_percent),
            m.training,
        )
        for m in reduction.models
    ]
    if not rows:
        return [Paragraph("; ".join(reduction.rounds).capitalize() + ".")]
    rounds = tuple(text[:1].upper() + text[1:] + "." for text in reduction.rounds)
    return [Paragraph(_verdict(reduction)), Table("Reduced models", heads, tuple(rows), _COST), Listing(rounds)]


def _verdict(reduction: ReductionResults) -> str:
    tolerance = f"{short(reduction.tolerance_percent)} %"
    if reduction.certified:
        return f"The search ran on reduced models; the full model agrees with them at the end within {tolerance}."
    return (
        f"The search ran on reduced models, and the full model still differs from them at the end by more than "
        f"{tolerance}: residuals and frequencies above are the full model's, but the values may not be its optimum. "
        "Allow more full solutions."
    )
