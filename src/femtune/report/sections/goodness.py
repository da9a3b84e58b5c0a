"""Are the residuals noise of the stated size? In words, and by kind of residual."""

from __future__ import annotations

from femtune.report.document import Block, Paragraph, Table, Tone, columns, row
from femtune.report.numbers import NONE, short
from femtune.report.source import Source
from femtune.study.results_validation import GoodnessResults

_TONES: dict[str, Tone] = {"pass": "", "fail": "poor", "not tested": "muted"}


def goodness_sentence(source: Source) -> list[Block]:
    """One sentence, where it was tested."""
    found = _found(source)
    return [] if found is None else [Paragraph(f"Residuals: {found.sentence}.", _TONES[found.verdict])]


def goodness(source: Source) -> list[Block]:
    """The sentence, and chi-square by kind."""
    found = _found(source)
    if found is None or not found.by_kind:
        return goodness_sentence(source)
    heads = columns("Residuals", ">Chi-square", ">Degrees of freedom", ">p")
    rows = [row(k.kind, short(k.chi_square), str(k.degrees_of_freedom), _chance(k.p_value)) for k in found.by_kind]
    if len(found.by_kind) > 1:
        rows.append(row("all", short(found.chi_square), str(found.degrees_of_freedom), _chance(found.p_value)))
    note = (
        "p is the chance of a chi-square as large by noise of the stated standard deviations alone; of the residuals "
        "what no parameters could remove is looked at."
    )
    return [*goodness_sentence(source), Table("Are the residuals noise?", heads, tuple(rows), note)]


def _chance(p: float | None) -> str:
    return NONE if p is None else short(p) if p >= 1e-12 else "< 1e−12"


def _found(source: Source) -> GoodnessResults | None:
    return source.results.update.goodness if source.results.update is not None else None
