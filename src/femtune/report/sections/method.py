"""How it was computed, and what to cite."""

from __future__ import annotations

from femtune.report.document import Block, Details, Listing, Paragraph
from femtune.report.numbers import counted, short
from femtune.report.source import Source
from femtune.study.results_base import Citation
from femtune.study.results_update import UpdateResults


def method(source: Source) -> list[Block]:
    """Solver, regularisation, residuals; publications with their BibTeX."""
    update = source.results.update
    cited = _citations(source)
    listing: list[Block] = (
        [Listing(tuple(c.text for c in cited))] if cited else [Paragraph("No citation was registered.")]
    )
    bibtex = [Details("BibTeX", "\n\n".join(c.bibtex for c in cited))] if cited else []
    return [Paragraph(_sentence(update) if update else "The update was not run."), *listing, *bibtex]


def _citations(source: Source) -> list[Citation]:
    own = source.results.update.citations if source.results.update else ()
    return list({c.key: c for c in (*own, *source.results.citations)}.values())


def _sentence(update: UpdateResults) -> str:
    kinds = ", ".join(counted(r.count, f"{r.kind} residual") for r in update.residual_counts) or "no residuals"
    weight = update.regularisation_weight
    weighed = f", weight {short(weight)}" if weight is not None else ""
    return f"Solver: {update.method}. Compared: {kinds}. Regularisation: {update.regularisation}{weighed}."
