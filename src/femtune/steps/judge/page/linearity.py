"""The table of true and linear χ² along the principal axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Paragraph, Table, columns, row
from femtune.document.numbers import counted, short

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.report_source import ReportSource

_NOTE = (
    "Increase of χ² over that of the result, along the principal axes of the covariance. An axis is named by its "
    "largest parts. Where the increase of the model is much larger than that of the linearised residuals, the "
    "valley of χ² is curved, and standard deviations and intervals do not apply."
)


def linearity_blocks(source: ReportSource) -> list[Block]:
    """True beside linear χ²; a sentence where it was not tested."""
    judged = source.results.judgement
    linearity = None if judged is None else judged.linearity
    if linearity is None:
        return []
    if not linearity.points:
        why = linearity.reason or "no combination of the parameters is determined"
        return [Paragraph(f"Whether χ² is a parabola near the result was not tested: {why}.", tone="muted")]
    heads = columns("Principal axis", ">Standard deviations", ">Linear increase of χ²", ">of the model", "Linear")
    rows = tuple(
        row(
            p.axis, f"{p.step:+.2f}".replace("-", "−"), short(p.linear),
            "not solved" if p.true is None else short(p.true), "no" if p.curved else "yes",
        )
        for p in linearity.points
    )  # fmt: skip
    more = (
        f" {counted(linearity.axes_left, 'further axis', 'further axes')} not evaluated." if linearity.axes_left else ""
    )
    return [Table("True and linear χ²", heads, rows, _NOTE + more, folded=not any(p.curved for p in linearity.points))]
