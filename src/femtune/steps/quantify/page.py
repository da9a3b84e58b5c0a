"""Variability of the parameters over repeated tests: tables, forward check and ellipses."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Cell, Figure, Listing, Paragraph, Section, Table, columns, row
from femtune.document.figures.parameters import Cloud, clouds_svg
from femtune.document.numbers import counted, freq, listed, short, signed_percent, value
from femtune.steps.quantify.record import ORDER
from femtune.steps.validate.page import verdict_cell
from femtune.uncertainty.kinds import QUANTIFY_METHODS

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.quantify.record import QuantifiedOutput, QuantifiedParameter, QuantifyResults
    from femtune.steps.report_source import ReportSource, Subject


_MOST_LISTED = 24
"""Rows of each table; more rows make the page long without showing more, and are in the results."""


def quantify(source: ReportSource) -> list[Block]:
    """Blocks of the report; a sentence where the study has no repeats."""
    record = source.results.quantify
    if record is None:
        return [
            Paragraph("Not tested: the study has no repeated tests; the variability of the parameters is not known.")
        ]
    return [*variability_blocks(record), *_pictures(source, record)]


def variability_blocks(record: QuantifyResults) -> list[Block]:
    """Sentences and tables, for page and terminal."""
    first, *others = record.sentences
    rest = [Listing(tuple(others))] if others else []
    return [
        Paragraph(first), *rest, Paragraph(_how(record)), parameter_table(record), output_table(record),
        *entry_tables(record), *check_tables(record), *interval_blocks(record), *population_blocks(record),
    ]  # fmt: skip


def _how(record: QuantifyResults) -> str:
    held = f" ({counted(len(record.held_out), 'other')} held out)" if record.held_out else ""
    return (
        f"{counted(record.repeats, 'repeat')}{held} of {record.configuration}; mean and covariance of the repeats: "
        f"{record.estimate}. Method: {QUANTIFY_METHODS[record.method].text}; "
        f"{counted(record.solutions, 'model solution')}. Forward check: {record.samples} samples of a Latin hypercube."
    )


def parameter_table(record: QuantifyResults) -> Table:
    """Mean, standard deviation and correlations."""
    shown = record.parameters[:_MOST_LISTED]
    few = len(shown) <= 8
    heads = columns(
        "Parameter",
        ">Initial",
        ">Mean",
        ">σ",
        ">σ / mean",
        ">Distance",
        *(f">corr. {p.parameter}" for p in shown if few),
    )
    note = (
        "σ is the standard deviation of single structures or assemblies, not of the mean. Distance: 1 − cosine "
        "between the effects of the parameter and the measured covariance; it is near 0 for parameters that vary."
    )
    if len(record.parameters) > len(shown):
        note += f" And {counted(len(record.parameters) - len(shown), 'more parameter')} in the results."
    return Table("Variability of the parameters", heads, tuple(_parameter(p, few) for p in shown), note)


def _parameter(p: QuantifiedParameter, few: bool) -> tuple[Cell, ...]:
    correlations = [f"{c:+.2f}" for c in p.correlation] if few else []
    mean = Cell(value(p.mean), tone="poor") if p.outside_bounds else Cell(value(p.mean))
    ratio = signed_percent(100.0 * p.sd / abs(p.mean)).lstrip("+") if p.mean else "–"
    return row(p.parameter, value(p.start), mean, short(p.sd), ratio, short(p.cosine_distance), *correlations)


def output_table(record: QuantifyResults) -> Table:
    """Measured moments, compared with those of the cloud."""
    heads = columns(
        "Mode", ">Repeats", ">Measured mean Hz", ">Model mean Hz", ">Measured σ Hz", ">Robust σ Hz", ">Model σ Hz"
    )
    note = (
        f"The covariances of measurement and model differ by {short(record.covariance_error_percent)} %. The expected "
        f"sampling error of the measured covariance is {short(record.chance_error_percent)} % for independent repeats"
    )
    depends = any(c.check == ORDER and c.verdict == "fail" for c in record.checks)
    note += "; these depend on their order, so that it is larger." if depends else "."
    if record.noise_percent is not None:
        note += " Model σ contains the stated measurement errors."
    if any(o.robust_sd_hz is not None for o in record.outputs):
        note += " Robust σ: that to which outliers do not contribute."
    return Table("Forward check", heads, tuple(map(_output, record.outputs[:_MOST_LISTED])), note)


def entry_tables(record: QuantifyResults) -> list[Table]:
    """Entries of the mode shapes; none if the study does not request shapes."""
    if not record.entries:
        return []
    rows = tuple(
        row(e.label, str(e.repeats), *map(short, (e.measured_mean, e.model_mean, e.measured_sd, e.model_sd)))
        for e in record.entries[:_MOST_LISTED]
    )
    heads = columns("Mode and sensor", ">Repeats", ">Measured mean", ">Model mean", ">Measured σ", ">Model σ")
    note = "Shapes have unit norm over the measured sensors, and the sign of the test."
    if len(record.entries) > len(rows):
        note += f" {counted(len(record.entries) - len(rows), 'more entry', 'more entries')} in the results."
    return [Table("Mode shapes in the forward check", heads, rows, note)]


def interval_blocks(record: QuantifyResults) -> list[Block]:
    """Intervals of the parameters and of the frequencies; none if the study does not request them."""
    box = record.intervals
    if box is None:
        return []
    parameters = tuple(row(p.parameter, value(p.lower), value(p.upper)) for p in box.parameters[:_MOST_LISTED])
    outputs = tuple(
        row(o.label, *map(freq, (o.measured_lower_hz, o.model_lower_hz, o.measured_upper_hz, o.model_upper_hz)))
        for o in box.outputs[:_MOST_LISTED]
    )
    heads = columns("Mode", ">Measured lowest Hz", ">Model lowest Hz", ">Measured highest Hz", ">Model highest Hz")
    note = "The measured limits are the smallest and the largest value of the repeats; more repeats have wider ones."
    tables = [
        Table("Intervals of the parameters", columns("Parameter", ">Lower", ">Upper"), parameters, note),
        Table("Extreme frequencies", heads, outputs),
    ]
    return [Paragraph(box.sentence), *(tables if parameters else [])]


def population_blocks(record: QuantifyResults) -> list[Block]:
    """Means, standard deviations and correlations with intervals; none if the study does not request them."""
    found = record.population
    if found is None:
        return []
    heads = columns("Parameter", ">Mean", ">95 % from", ">to", ">σ", ">95 % from", ">to", ">Further structure", ">to")
    rows = tuple(
        row(
            p.parameter, value(p.mean), *map(value, p.mean_interval_95), short(p.sd), *map(short, p.sd_interval_95),
            *map(value, p.new_interval_95),
        )
        for p in found.parameters[:_MOST_LISTED]
    )  # fmt: skip
    note = (
        "Samples of a normal distribution of the parameters over structures, whose own parameters are unknown too. The "
        "last two columns contain a further structure with 95 % probability."
    )
    tables = [Table("Population with its uncertainty", heads, rows, note)]
    pairs = tuple(
        row(c.first, c.second, f"{c.correlation:.2f}", *(f"{end:.2f}" for end in c.interval_95))
        for c in found.correlations[:_MOST_LISTED]
    )
    if pairs:
        tables.append(
            Table("Correlations over the population", columns("", "", ">Correlation", ">95 % from", ">to"), pairs)
        )
    return [Listing(found.sentences), *tables]


def check_tables(record: QuantifyResults) -> list[Table]:
    """Order of the tests, outliers, prediction of held-out repeats; none in results of earlier versions."""
    rows = tuple(
        row(c.check, "–" if c.p_value is None else short(c.p_value), verdict_cell(c.verdict), c.sentence)
        for c in record.checks
    )
    note = (
        "p is the probability of a result as extreme if there is no such effect; each test fails by chance in 5 % of "
        "all data sets. Repeats are taken in the order of the rows or files."
    )
    return [Table("Tests of the repeats", columns("Test", ">p", "Verdict", "Result"), rows, note)] if rows else []


def _output(o: QuantifiedOutput) -> tuple[Cell, ...]:
    means = freq(o.measured_mean_hz), freq(o.model_mean_hz)
    robust = "–" if o.robust_sd_hz is None else short(o.robust_sd_hz)
    return row(o.label, str(o.repeats), *means, short(o.measured_sd_hz), robust, short(o.model_sd_hz))


def _pictures(source: ReportSource, record: QuantifyResults) -> list[Block]:
    """Ellipses of the first outputs, and of the parameters."""
    repeats, cloud = source.array(record.repeats_key), source.array(record.cloud_key)
    covariance, spread = source.array(record.covariance_key), source.array(record.parameter_covariance_key)
    if repeats is None or cloud is None or covariance is None or spread is None:
        return []
    out: list[Block] = []
    if len(record.outputs) > 1:
        clouds = (
            Cloud("measured", repeats, np.array([o.measured_mean_hz for o in record.outputs]), covariance),
            Cloud("updated parameters", cloud, cloud.mean(axis=0), np.atleast_2d(np.cov(cloud.T))),
        )
        labels = [f"mode {o.label}, Hz" for o in record.outputs]
        caption = "Measured frequencies, and samples of the updated model; the ellipses contain 95 %."
        spreads = [f"mode {o.label}: {short(o.measured_sd_hz)} and {short(o.model_sd_hz)} Hz" for o in record.outputs]
        alt = f"{caption} Standard deviations: {listed(spreads)}"
        out.append(Figure(partial(clouds_svg, labels, clouds), caption, alt, wide=True))
    if len(record.parameters) > 1:
        mean = np.array([p.mean for p in record.parameters])
        empty_cloud = (Cloud("parameters", np.zeros((0, len(mean))), mean, spread),)
        caption = "95 % ellipses of the parameters."
        alt = f"{caption} {listed(f'{p.parameter} {value(p.mean)} ± {short(p.sd)}' for p in record.parameters)}"
        out.append(
            Figure(partial(clouds_svg, [p.parameter for p in record.parameters], empty_cloud), caption, alt, wide=True)
        )
    return out


def quantify_document(subject: Subject, record: QuantifyResults) -> Document:
    """The verdict is the first sentence."""
    first, *_ = record.sentences
    failed = any(c.verdict == "fail" for c in record.checks)
    level: Level = "info" if record.ok and record.agrees and not failed else "warning"
    words = tuple(b for b in variability_blocks(record)[1:] if isinstance(b, Listing))
    how = next(b for b in variability_blocks(record)[1:] if isinstance(b, Paragraph))
    sections = (
        Section("words", "Reliability", words),
        Section("parameters", "Variability of the parameters", (how, parameter_table(record))),
        Section("outputs", "Forward check", (output_table(record), *entry_tables(record))),
        *(Section("checks", "Tests of the repeats", (table,)) for table in check_tables(record)),
        *([Section("intervals", "Intervals", tuple(interval_blocks(record)))] if record.intervals else []),
        *([Section("population", "Population", tuple(population_blocks(record)))] if record.population else []),
    )
    return subject.document(first, level, sections)
