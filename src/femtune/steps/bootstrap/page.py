"""Bootstrap of the FRFs: spread of the parameters, histograms, correlations."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Figure, Listing, Paragraph, Section, Table, columns, row
from femtune.document.figures.histograms import histograms_svg
from femtune.document.figures.matrix import MatrixPicture, matrix_svg
from femtune.document.numbers import as_sentence, counted, short, value
from femtune.steps.report_source import warnings_of

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.bootstrap.record import BootstrappedParameter, BootstrapResults
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.results import Results


WHAT = {
    "lines": "Frequency lines were drawn with replacement, all FRFs of a line together",
    "entries": "Single FRF values were drawn with replacement",
    "noise": "Noise of the stated standard deviations was added to the results of the updated model",
}
IDENTIFIED = {
    "lines": "Frequency lines of the measured FRFs were drawn with replacement, all FRFs of a line together",
    "entries": "Single values of the measured FRFs were drawn with replacement",
    "noise": "Noise as large as the errors of the identified system was added to its FRFs",
}
_MOST_LISTED = 24
"""Parameters in the table and in the pictures; more make the page long without showing more, and are in the results."""
_LARGE_BIAS = 0.5
"""Bias relative to the standard deviation from which it is marked.

At half a standard deviation the shift of a 95 % interval is a quarter of its half-width.
"""


def bootstrap(source: ReportSource) -> list[Block]:
    """Blocks of the report; a sentence where the study asks for no bootstrap."""
    record = source.results.bootstrap
    if record is None:
        return [Paragraph("Not tested: the study has no [bootstrap]; it can be made for residuals of measured FRFs.")]
    return [*bootstrap_blocks(record), *_pictures(source, record)]


def bootstrap_blocks(record: BootstrapResults) -> list[Block]:
    """Sentences and table, for page and terminal."""
    return [Listing((*record.sentences, *record.remarks)), Paragraph(_how(record)), parameter_table(record)]


def _how(record: BootstrapResults) -> str:
    drawn = "" if record.method == "noise" else f" from {record.drawn_from}"
    what = WHAT[record.method]
    if record.identified:
        what = f"{IDENTIFIED[record.method]}{drawn}; the test was identified again with them, and its damping equalised"
    else:
        what = f"{what}{drawn}"
    derivatives = (
        f"derivatives at the result of the update, in {counted(record.own_jacobian, 'run')} at other points"
        if record.jacobian == "shared"
        else "derivatives at every point"
    )
    recalled = f", {record.recalled} of them from an earlier run" if record.recalled else ""
    return (
        f"{what}. {counted(record.runs, 'run')} (seed {record.seed}){recalled}, each by "
        f"Gauss-Newton steps from the result of the update with {derivatives}. "
        f"{counted(record.solutions, 'model solution')} in {short(record.seconds)} s by {record.executor}."
    )


def parameter_table(record: BootstrapResults) -> Table:
    """Result, mean, standard deviations, bias, interval."""
    heads = columns(
        "Parameter", ">Result", ">Mean", ">σ", ">COV %", ">Bias / σ", ">95 % from", ">to", ">Fisher σ", ">Fisher COV %"
    )
    note = (
        "COV is the standard deviation over the mean of the parameter itself. Bias is the mean of the runs less the "
        "result. Fisher σ follows from the inverse Fisher information and the stated standard deviations of the FRFs."
    )
    if len(record.parameters) > _MOST_LISTED:
        note += f" And {counted(len(record.parameters) - _MOST_LISTED, 'more parameter')} in the results."
    return Table("Bootstrap", heads, tuple(map(_parameter, record.parameters[:_MOST_LISTED])), note)


def _parameter(p: BootstrappedParameter) -> tuple[Cell, ...]:
    bias = f"{p.bias:+.2f}"
    return row(
        p.parameter, value(p.value), value(p.mean), short(p.sd), short(p.cov_percent),
        Cell(bias, tone="poor") if abs(p.bias) > _LARGE_BIAS else bias,
        value(p.interval_95[0]), value(p.interval_95[1]), short(p.fisher_sd), short(p.fisher_cov_percent),
    )  # fmt: skip


def _pictures(source: ReportSource, record: BootstrapResults) -> list[Block]:
    """Histograms of the free parameters, and their correlation."""
    samples, correlation = source.array(record.samples_key), source.array(record.correlation_key)
    if samples is None or correlation is None:
        return []
    names = record.free[:_MOST_LISTED]
    by_name = {p.parameter: p for p in record.parameters}
    known = [by_name[name] for name in names]
    draw = partial(histograms_svg, names, samples, [p.value for p in known], [p.interval_95 for p in known])
    caption = "Distribution of the parameters over the runs. Line: result of the update. Shaded: 95 % interval."
    alt = "; ".join(f"{p.parameter} {value(p.mean)} ± {short(p.sd)}" for p in known)
    out: list[Block] = [Figure(draw, caption, f"{caption} {alt}", wide=True)]
    if len(names) > 1:
        picture = MatrixPicture(correlation[: len(names), : len(names)], names, names, "", "", signed=True)
        words = "Correlation of the parameters over the runs."
        out.append(Figure(partial(matrix_svg, picture), words, words))
    return out


def bootstrap_document(subject: Subject, results: Results) -> Document:
    """The first sentence, or why there is no bootstrap."""
    record = results.bootstrap
    if record is None:
        reasons = [a.sentence for a in results.alerts if a.code.startswith(("bootstrap.", "executor."))]
        return subject.document(as_sentence((reasons or ["there was no bootstrap"])[0]), "problem", ())
    sections = (Section("bootstrap", "Bootstrap", tuple(bootstrap_blocks(record))), *warnings_of(results))
    warned = any(a.code.startswith("bootstrap.") and a.level != "info" for a in results.alerts)
    level: Level = "info" if record.converged == record.runs and not warned else "warning"
    return subject.document(record.sentences[0], level, sections)
