"""Sections of the report: the method of the run, and publications to cite."""

from __future__ import annotations

from typing import TYPE_CHECKING

from femtune.document.document import Details, Listing, Paragraph, Table, columns, row, table_or_none
from femtune.document.numbers import counted, listed, short

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.report_source import ReportSource
    from femtune.steps.update.record.update import UpdateResults
    from femtune.study.record import CitationRecord


def method(source: ReportSource) -> list[Block]:
    """Solver, regularisation, residuals; publications with their BibTeX."""
    update = source.results.update
    cited = _citations(source)
    listing: list[Block] = [Listing(tuple(c.text for c in cited))] if cited else [Paragraph("There are no citations.")]
    bibtex = [Details("BibTeX", "\n\n".join(c.bibtex for c in cited))] if cited else []
    return [Paragraph(_sentence(update) if update else "The update was not run."), *listing, *bibtex]


def _citations(source: ReportSource) -> list[CitationRecord]:
    of_update = source.results.update.citations if source.results.update else ()
    return list({c.key: c for c in (*of_update, *source.results.citations)}.values())


def _sentence(update: UpdateResults) -> str:
    kinds = ", ".join(counted(r.count, f"{r.kind} residual") for r in update.residual_counts) or "no residuals"
    weight = update.regularisation_weight
    weighed = f", weight {short(weight)}" if weight is not None else ""
    of_test = [r.kind for r in update.residual_counts if r.sd_of_test]
    deviations = f" The standard deviations of {listed(of_test)} residuals are those of the test." if of_test else ""
    return f"Solver: {update.method}. Compared: {kinds}.{deviations} Regularisation: {update.regularisation}{weighed}."


def provenance(source: ReportSource) -> list[Block]:
    """Versions, files with their check sums, durations."""
    origin = source.results.provenance
    facts = {
        "Command": origin.command,
        "Started": origin.started_at,
        "femtune": origin.femtune_version,
        "Python, numpy, scipy": f"{origin.python_version}, {origin.numpy_version}, {origin.scipy_version}",
        "Eigen-solver": origin.eigen_solver,
        "Schema of the results": source.results.schema_version,
    }
    files = [row(f.path, f.sha256) for f in (origin.study_file, *origin.input_files)]
    times = [row(d.step, short(d.duration_s)) for d in origin.durations]
    return [
        Table("Run", columns("What", "Value"), tuple(row(k, v) for k, v in facts.items())),
        Table("Files read", columns("File", "SHA-256"), tuple(files)),
        table_or_none("Time", columns("Step", ">s"), times, "Durations were not recorded."),
    ]
