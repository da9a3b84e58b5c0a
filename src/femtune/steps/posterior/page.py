"""Posterior distribution: intervals beside those of linearised residuals, histograms, bent pairs."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import Cell, Figure, Listing, Paragraph, Section, Table, columns, row
from femtune.document.figures.posterior import BandPanel, bands_svg, marginals_svg, pairs_svg
from femtune.document.numbers import as_sentence, counted, interval, short, value
from femtune.steps.report_source import warnings_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from femtune.document.document import Block, Document, Level
    from femtune.steps.posterior.record import (
        PosteriorFrequency,
        PosteriorFunctions,
        PosteriorParameter,
        PosteriorResults,
    )
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.results import Results

_MOST_LISTED = 24
"""Parameters in the table and in the pictures; the others are in the results."""
_MOST_FURTHER = 6
"""Parameters in the table of further tests."""
_MOST_PAIRS = 4
"""Bent pairs that are drawn."""
_MOST_PREDICTED = 40
"""Predicted frequencies in the table; all are in the results."""
_MOST_BANDS = 6
"""FRFs of a configuration that are drawn with their bands."""


def posterior(source: ReportSource) -> list[Block]:
    """Blocks of the report; a sentence where the study asks for no samples."""
    record = source.results.posterior
    if record is None:
        return [Paragraph("Not tested: the study has no [posterior].")]
    return [*posterior_blocks(record), *_pictures(source, record)]


def posterior_blocks(record: PosteriorResults) -> list[Block]:
    """Sentences and tables, for page and terminal."""
    errors = [model_error_table(record)] if record.model_errors else []
    further = [further_table(record)] if record.further else []
    predicted = [frequency_table(record)] if record.frequencies else []
    tables = [parameter_table(record), noise_table(record), *errors, *predicted, *further]
    return [Listing(record.sentences), Paragraph(_how(record)), *tables]


def _how(record: PosteriorResults) -> str:
    drawn = (
        "the linearised residuals" if record.drawn_from == "linear"
        else f"a surrogate of the residuals of degree {record.degree}"
    )  # fmt: skip
    drawn = f"drawn from {drawn}, R-hat {record.r_hat:.3f}, and weighted by" if record.r_hat is not None else (
        f"drawn in {record.stages} stages of transitional Markov chain Monte Carlo on"
    )  # fmt: skip
    tried = f" Before: {'; '.join(record.tried)}." if record.tried else ""
    recalled = f", {record.recalled} of them from an earlier run" if record.recalled else ""
    starts = (
        f" {counted(record.starts, 'update')} from other points looked for further regions." if record.starts else ""
    )
    orders = ", ".join(map(str, record.reduced_orders))
    on = f" on reduced models of order {orders}" if orders else ""
    return (
        f"{record.draws} samples (seed {record.seed}) {drawn} the model{on}.{tried}{starts} "
        f"{counted(record.gradient_solutions, 'solution')} with derivatives and {record.plain_solutions} without"
        f"{recalled}, in {short(record.seconds)} s by {record.executor}."
    )


def parameter_table(record: PosteriorResults) -> Table:
    """Mean, standard deviation and interval, beside the interval of linearised residuals and that of the update."""
    with_errors = bool(record.model_errors)
    heads = columns(
        "Parameter", ">Update", ">Median", ">Mean", ">σ", ">95 % from", ">to",
        *((">Data alone from", ">to") if with_errors else ()), ">Linear from", ">to", ">Update from", ">to",
        ">σ / σ before",
    )  # fmt: skip
    note = ("Data alone: without errors of the model. " if with_errors else "") + (
        "Linear: with linearised residuals, the same prior and the same rule for the size of the errors. Update: the "
        "interval of the update, with its standard deviations. The last column is 1 where the data contain no "
        "information."
    )
    if len(record.parameters) > _MOST_LISTED:
        note += f" And {counted(len(record.parameters) - _MOST_LISTED, 'more parameter')} in the results."
    return Table("Posterior distribution", heads, tuple(map(_parameter, record.parameters[:_MOST_LISTED])), note)


def _parameter(p: PosteriorParameter) -> tuple[Cell, ...]:
    update = ("", "") if p.update_interval_95 is None else tuple(map(value, p.update_interval_95))
    alone = () if p.of_data_interval_95 is None else tuple(map(value, p.of_data_interval_95))
    share = "" if p.prior_sd is None else f"{p.sd / p.prior_sd:.2g}"
    return row(
        p.parameter, value(p.value), value(p.median), value(p.mean), short(p.sd), *map(value, p.interval_95),
        *alone, *map(value, p.linear_interval_95), *update, Cell(share, tone="poor") if p.of_bounds else share,
    )  # fmt: skip


def noise_table(record: PosteriorResults) -> Table:
    """Size of the errors by kind."""
    heads = columns("Residuals", ">Independent", ">Errors / stated", ">95 % from", ">to")
    rows = tuple(
        row(
            n.residuals, short(n.count), short(n.factor),
            *(("as stated", "") if n.interval_95 is None else tuple(map(short, n.interval_95))),
        )
        for n in record.noise_levels
    )  # fmt: skip
    return Table("Size of the errors", heads, rows)


def model_error_table(record: PosteriorResults) -> Table:
    """Sizes of the errors of the model, with the changes that the data want most."""
    heads = columns(
        "Errors of the model", ">Unknown changes", ">σ, %", ">95 % from", ">to", "Changes that the data want"
    )
    rows = tuple(
        row(
            c.what, short(c.count), short(c.sd_percent), *map(short, c.interval_95),
            "; ".join(f"{w.what} {w.change_percent:+.2g} %" for w in record.wanted if w.of == c.what),
        )
        for c in record.model_errors
    )  # fmt: skip
    note = (
        "Unknown changes of properties, masses and supports that no parameter represents. Their standard deviation "
        "follows from the data, relative to the usual change of a field: 20 % of a stiffness, 10 % of a mass. Masses "
        "that the deck does not have are relative to 5 % of the mass of the model, supports to the largest plausible "
        "compliance."
    )
    return Table("Errors of the model", heads, rows, note)


def frequency_table(record: PosteriorResults) -> Table:
    """Predicted frequencies, those that were measured and not used first."""
    heads = columns("Configuration", ">Mode", ">Update, Hz", ">95 % from", ">to", "Test mode", ">Measured, Hz", "")
    order = sorted(record.frequencies, key=lambda f: (f.measured_hz is None, f.used))
    note = (
        f"The full model at {record.predictions - record.predictions_failed} samples, {_with_errors(record)}. Inside: "
        "the measured frequency is in the 95 % interval of a measurement, which has errors of the test as well."
    )
    if len(order) > _MOST_PREDICTED:
        note += f" And {counted(len(order) - _MOST_PREDICTED, 'more frequency', 'more frequencies')} in the results."
    return Table("Predicted frequencies", heads, tuple(map(_frequency, order[:_MOST_PREDICTED])), note)


def _frequency(f: PosteriorFrequency) -> tuple[Cell, ...]:
    told = "" if f.measured_inside is None else "inside" if f.measured_inside else "outside"
    use = f"{told}, {'used' if f.used else 'not used'}" if told else ""
    return row(
        f.configuration, str(f.mode), value(f.value_hz), *interval(*f.interval_95, 5), f.test_mode or "",
        "" if f.measured_hz is None else value(f.measured_hz), Cell(use, tone="poor") if told == "outside" else use,
    )  # fmt: skip


def further_table(record: PosteriorResults) -> Table:
    """A line each configuration without a test, a column each parameter."""
    names = [p.parameter for p in record.further[0].parameters][:_MOST_FURTHER]
    heads = columns("Configuration", ">Frequencies", ">Bits", *(f">{name}" for name in names))
    rows = tuple(
        row(
            f.configuration, str(len(f.modes)), f"{f.bits:.1f}",
            *(f"{short(p.sd)} → {short(p.sd_after)}" for p in f.parameters[:_MOST_FURTHER]),
        )
        for f in record.further
    )  # fmt: skip
    left = len(record.further[0].parameters) - len(names)
    note = (
        "Configurations of the study without a test. Expected information, and standard deviation of each parameter "
        f"now and after a test of these frequencies with errors of {100.0 * record.further_sd:.2g} %; the model has no "
        "errors in that test."
    )
    if left:
        note += f" And {counted(left, 'more parameter')} in the results."
    return Table("What a further test would teach", heads, rows, note)


def _pictures(source: ReportSource, record: PosteriorResults) -> list[Block]:
    samples, weights, linear = (
        source.array(key) for key in (record.samples_key, record.weights_key, record.linear_key)
    )
    if samples is None or weights is None or linear is None:
        return []
    names = record.free[:_MOST_LISTED]
    by_name = {p.parameter: p for p in record.parameters}
    intervals = [by_name[n].interval_95 for n in names]
    draw = partial(marginals_svg, names, samples, weights, linear, [by_name[n].value for n in names], intervals)
    caption = (
        "Distribution of the parameters. Filled: the samples. Line: samples of linearised residuals. Vertical line: "
        "the result of the update. Shaded: the 95 % interval."
    )
    alt = "; ".join(f"{n} {value(by_name[n].median)} ± {short(by_name[n].sd)}" for n in names)
    out: list[Block] = [Figure(draw, caption, f"{caption} {alt}", wide=True)]
    places = {n: i for i, n in enumerate(record.free)}
    pairs = [(b.first, b.second) for b in record.bent if b.first in places and b.second in places][:_MOST_PAIRS]
    if pairs:
        # as many points as effective samples, drawn by their weights
        rng = np.random.default_rng(record.seed)
        chosen = samples[rng.choice(len(samples), len(samples), p=weights)]
        columns_of = [(places[a], places[b]) for a, b in pairs]
        words = (
            "Pairs of parameters whose joint distribution is bent: samples, and in grey those of linearised residuals."
        )
        out.append(Figure(partial(pairs_svg, pairs, columns_of, chosen, linear), words, words, wide=True))
    return [*out, *(figure for one in record.functions for figure in _bands(source, one, _with_errors(record)))]


def _with_errors(record: PosteriorResults) -> str:
    return "with errors of the model as the data leave them" if record.model_errors else "without errors of the model"


def _bands(source: ReportSource, record: PosteriorFunctions, errors: str) -> Iterator[Figure]:
    """The first functions with their bands; `errors` says whether they contain errors of the model."""
    hz, band = source.array(record.freq_key), source.array(record.band_key)
    keys = (record.test_freq_key, record.test_values_key)
    test_hz, test = (None if key is None else source.array(key) for key in keys)
    if hz is None or band is None:
        return
    places = [(i, j) for i in range(len(record.outputs)) for j in range(len(record.inputs))]
    panels = [
        BandPanel(
            f"{record.outputs[i]} / {record.inputs[j]}", record.kind, hz, band[:, i, j],
            None if test is None or test_hz is None or not np.isfinite(test[i, j]).any()
            else (test_hz, np.abs(test[i, j])),
        )
        for i, j in places[:_MOST_BANDS]
    ]  # fmt: skip
    left = f" {counted(len(places) - len(panels), 'more function')} in the arrays." if len(places) > len(panels) else ""
    of_test = "; wide and pale the test" if any(panel.measured is not None for panel in panels) else ""
    words = (
        f"FRFs of {record.configuration} over the samples: median and 95 % band of the magnitude, {errors}{of_test}."
        f"{left}"
    )
    yield Figure(partial(bands_svg, panels), words, words, wide=True)


def posterior_document(subject: Subject, results: Results) -> Document:
    """The first sentence, or why there is no distribution."""
    record = results.posterior
    if record is None:
        reasons = [a.sentence for a in results.alerts if a.code.startswith(("posterior.", "executor."))]
        return subject.document(as_sentence((reasons or ["there are no samples"])[0]), "problem", ())
    sections = (Section("posterior", "Posterior distribution", tuple(posterior_blocks(record))), *warnings_of(results))
    levels = {a.level for a in record.alerts}
    level: Level = "problem" if "problem" in levels else "warning" if "warning" in levels else "info"
    return subject.document(record.sentences[0], level, sections)
