"""Validation on data that the update did not use, goodness of fit and criteria: sections and terminal."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.document import (
    Cell,
    Column,
    Figure,
    Heading,
    Listing,
    Paragraph,
    Section,
    Table,
    columns,
    row,
    without_column,
)
from femtune.document.figures.bars import PredictedMode, predictions_svg
from femtune.document.figures.frfs import FrfCurve, FrfPanel, frfs_svg
from femtune.document.numbers import (
    NONE,
    NOT_TESTED,
    as_sentence,
    counted,
    freq,
    listed,
    percent,
    short,
    signed_percent,
    unit_fraction,
    value,
    with_unit,
)
from femtune.steps.modes.page.modes import mac_cell
from femtune.steps.report_source import VERSION_HEADS, VERSION_WORDS, versions, warnings_of
from femtune.steps.validate.record.validation import ValidationResults
from femtune.steps.vibration.page import modes_sentence, vibration_blocks

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level, Tone
    from femtune.steps.correlate.record.correlation import CriterionRecord
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.results import Results
    from femtune.steps.validate.record.frf_validation import PredictedCurves, PredictedResonance
    from femtune.steps.validate.record.validation import GoodnessResults, Prediction, ValidationVerdict
    from femtune.study.record import ModelVersion

_VERDICT_TONES: dict[str, Tone] = {"pass": "good", "fail": "poor", "not tested": "muted"}


def verdict_cell(verdict: str) -> Cell:
    """Pass, fail or not tested, in its tone."""
    return Cell(verdict, tone=_VERDICT_TONES[verdict])


def validation(source: ReportSource) -> list[Block]:
    """Verdicts, predictions compared with measurements, held-out sensors, then the list of what was not tested."""
    record = source.results.validation
    if record is None:
        return [Paragraph("Not tested: no validation was run, so that the quality of predictions is not known.")]
    return [
        *validation_verdicts(record),
        *_picture(record),
        *prediction_blocks(record, [m.reason for m in source.left_out()]),
        *sensor_blocks(record),
        *deviation_blocks(record),
        *frf_blocks(record),
        *_frf_figures(source, record),
        *vibration_blocks(source, record),
        Heading("What was not tested"),
        _listing([*untested_reasons(record), *record.not_tested]),
    ]


def _listing(lines: list[str]) -> Block:
    return Listing(tuple(lines)) if lines else Paragraph("There are no entries.")


def outcome_sentence(validation: ValidationResults) -> str:
    """How many criteria passed on data that were not used, without a full stop; "" where none was tested."""
    tested = [v for v in validation.verdicts if v.verdict != NOT_TESTED]
    failed = [v for v in tested if v.verdict == "fail"]
    if not tested:
        return ""
    count = f"{len(tested) - len(failed)} of {counted(len(tested), 'criterion', 'criteria')}"
    untested = len(validation.verdicts) - len(tested)
    rest = f", {untested} {'was' if untested == 1 else 'were'} not tested" if untested else ""
    where = listed(dict.fromkeys(v.configuration for v in failed))
    tail = f"; {len(failed)} failed in {where}" if failed else ""
    return f"on data that the update did not use {count} passed ({validation.profile}){rest}{tail}"


def validation_verdicts(validation: ValidationResults) -> list[Block]:
    """The outcome in a sentence, and a table of the criteria that were tested."""
    sentence = outcome_sentence(validation)
    if not sentence:
        return []
    tested = [v for v in validation.verdicts if v.verdict != NOT_TESTED]
    heads = columns(
        "Configuration", "Data", "Criterion", ">Required", ">Before the update", ">Measured", "Verdict", "Decided by"
    )
    table = Table("", heads, tuple(_verdict_row(v) for v in tested))
    if all(v.before is None for v in tested):
        table = without_column(table, "Before the update")
    noise = tuple(f"{v.configuration}, {v.criterion}: {v.noise}" for v in validation.verdicts if v.noise)
    misses: list[Block] = [Heading("Can measurement noise explain the failures?"), Listing(noise)] if noise else []
    tone: Tone = "poor" if any(v.verdict == "fail" for v in validation.verdicts) else "good"
    return [Paragraph(as_sentence(sentence), tone), table, *misses]


def _verdict_row(v: ValidationVerdict) -> tuple[Cell, ...]:
    asked = with_unit(f"{'≤' if v.sense == 'at most' else '≥'} {value(v.required)}", v.unit)
    measured = NOT_TESTED if v.measured is None else with_unit(short(v.measured), v.unit)
    before = NONE if v.before is None else with_unit(short(v.before), v.unit)
    initial = Cell(before, tone=_VERDICT_TONES.get(v.before_verdict or "", ""))
    return row(
        v.configuration, v.data, v.criterion, asked, initial, measured, verdict_cell(v.verdict), v.remark or NONE
    )


def untested_reasons(validation: ValidationResults) -> list[str]:
    """Criteria that were not tested, those with one reason together."""
    reasons: dict[tuple[str, str], dict[str, None]] = {}
    for v in validation.verdicts:
        if v.verdict == NOT_TESTED:
            reasons.setdefault((v.configuration, v.remark), {})[v.criterion] = None
    return [f"{name}: {'; '.join(criteria)}: {reason}" for (name, reason), criteria in reasons.items()]


def _picture(validation: ValidationResults) -> list[Block]:
    modes = [_predicted(p) for p in validation.predictions if p.data and p.freq_error_percent is not None]
    if not modes:
        return []
    limits = [v.required for v in validation.verdicts if v.criterion.startswith("frequency error")]
    limit = min(limits, default=None)
    caption = (
        "Errors of predicted frequencies, (model − test)/test. Grey ring: before the update. Blue dot: after the "
        "update. Bar: ± 2 σ about zero, from the uncertainty of test and parameters."
        + (f" Orange lines: the strictest limit of the criteria ({value(limit)} %)." if limit else "")
    )
    alt = f"Errors of {counted(len(modes), 'predicted frequency', 'predicted frequencies')} with their uncertainty"
    return [Figure(lambda: predictions_svg(modes, limit), caption, alt)]


def _predicted(p: Prediction) -> PredictedMode:
    known = p.test_sd_percent is not None
    sd = ((p.test_sd_percent or 0.0) ** 2 + (p.parameter_sd_percent or 0.0) ** 2) ** 0.5 if known else None
    label = f"{p.configuration}, mode {p.test_label}"
    return PredictedMode(label, p.before_freq_error_percent, p.freq_error_percent or 0.0, sd)


def prediction_blocks(validation: ValidationResults, known_reasons: list[str]) -> list[Block]:
    """All measured modes that the update did not use: one table for each configuration and kind of data."""
    if not validation.predictions:
        return [Paragraph("No measured mode was held out, so that the quality of predictions was not tested.")]
    groups: dict[str, list[Prediction]] = {}
    for p in validation.predictions:
        groups.setdefault(f"{p.configuration}: {p.data or 'left out'}", []).append(p)
    tables = [_predictions(title, rows, known_reasons) for title, rows in groups.items()]
    note = "z is the error divided by the σ of test and parameters; uncertainty does not explain errors beyond |z| = 2."
    known = any(p.z is not None for p in validation.predictions)
    return [Heading("Measured modes that the update did not use"), *tables, *([Paragraph(note, "muted")] * known)]


def _predictions(title: str, rows: list[Prediction], known_reasons: list[str]) -> Table:
    heads = (
        *columns("Mode", ">Test Hz", ">Model no.", ">Hz"),
        *(Column(head, "right", "Error %") for head in ("before", "after")),
        *(Column(head, "right", "σ %") for head in ("test", "parameters")),
        *columns(">z", ">MAC", "Remark"),
    )
    table = Table(title, heads, tuple(_row(p, known_reasons) for p in rows))
    return table if any(_remark(p, known_reasons) for p in rows) else without_column(table, "Remark")


def _row(p: Prediction, known_reasons: list[str]) -> tuple[Cell, ...]:
    return row(
        p.test_label,
        freq(p.test_freq_hz),
        str(p.model_number) if p.model_number is not None else "no similar mode",
        freq(p.model_freq_hz),
        signed_percent(p.before_freq_error_percent),
        signed_percent(p.freq_error_percent),
        percent(p.test_sd_percent),
        percent(p.parameter_sd_percent),
        NONE if p.z is None else signed_percent(p.z),
        mac_cell(p.mac),
        Cell(_remark(p, known_reasons), tone="muted"),
    )


def _remark(p: Prediction, known_reasons: list[str]) -> str:
    """The study's reason for leaving out a mode is given in the table of these modes."""
    if p.data:
        return "" if p.paired else "not paired; the most similar mode is shown"
    return "left out by the study" if p.remark in known_reasons else p.remark


def sensor_blocks(validation: ValidationResults) -> list[Block]:
    """Shapes at the sensors that were held out."""
    if not validation.held_out_sensors:
        return []
    heads = columns("Configuration", "Shape of", ">Error %", ">Expected noise %")
    rows = tuple(
        row(s.configuration, s.test_label, short(s.error_percent), short(s.noise_percent)) for s in validation.shapes
    )
    names = ", ".join(validation.held_out_sensors[:8])
    more = len(validation.held_out_sensors) - 8
    note = f"Held out: {names}{f' and {more} more' if more > 0 else ''}. "
    note += "The error is the RMS of test − model relative to that of the shape; it is scaled at the used sensors."
    return [Table("Shapes at held-out sensors", heads, rows, note)]


_MOST_UNFOLDED_ROWS = 16
"""Rows of the largest table of FRFs that is shown unfolded: about half a screen."""
_MOST_PANELS = 4
"""Functions in the figure, the largest ones first: they must stay large enough to be compared."""


def frf_blocks(validation: ValidationResults) -> list[Block]:
    """Measured FRFs that were not used, compared with those of the model, and their resonance peaks."""
    if not validation.frfs:
        return []
    heads = columns("Configuration", "Data", "FRF", ">FRAC", ">Mean level error dB", ">Largest dB", ">at Hz")
    rows = tuple(
        row(f.configuration, f.data, f"{f.output} / {f.input}", unit_fraction(f.frac, NONE), short(f.mean_db),
            short(f.max_db), freq(f.max_hz))
        for f in validation.frfs
    )  # fmt: skip
    peaks = columns("Configuration", "Input", ">Test Hz", ">Model Hz", ">Error %")
    resonances = tuple(
        row(r.configuration, r.input, freq(r.test_hz), freq(r.model_hz, "no peak"), _peak_error(r))
        for r in validation.resonances
    )
    note = "Level error: |20 lg(|H|/|H_test|)| over the frequency lines. FRAC is 1 for proportional functions."
    of_peaks = "Peaks of the sum of squares of the FRFs of one input."
    return [
        Heading("Measured FRFs that the update did not use"),
        Table("", heads, rows, note, folded=len(rows) > _MOST_UNFOLDED_ROWS),
        *([Table("Resonance peaks of these FRFs", peaks, resonances, of_peaks)] if resonances else []),
    ]


def deviation_table(validation: ValidationResults) -> list[Block]:
    """δ of the FRFs before and after the update by set and configuration, for page and terminal."""
    known = validation.deviations
    if known is None:
        return []
    heads = columns(
        "Set", "Compared", "Configuration", ">FRFs", ">δ before", ">δ after", ">Change %", ">FRFs with larger δ"
    )
    sums = known.sums + (known.by_configuration if len(known.by_configuration) > len(known.sums) else ())
    rows = tuple(
        row(s.data, s.compared, s.configuration or "all", str(s.frfs), short(s.before), short(s.after),
            NONE if s.change_percent is None else signed_percent(s.change_percent), str(s.risen))
        for s in sums
    )  # fmt: skip
    note = "δ is the mean over the lines of the squared magnitude of the decimal logarithm of H/H_test, phase included."
    return [Table("Deviation δ of the FRFs before and after the update", heads, rows, note)]


def deviation_blocks(validation: ValidationResults) -> list[Block]:
    """δ of the FRFs before and after the update, by set and by FRF; nothing where the update uses no FRFs."""
    known = validation.deviations
    if known is None:
        return []
    heads = columns("Set", "Compared", "Configuration", "FRF", ">Lines", ">δ before", ">δ after", ">Change %")
    rows = tuple(
        row(c.data, c.compared, c.configuration, f"{c.output} / {c.input}", str(c.lines), short(c.before),
            short(c.after),
            signed_percent(100.0 * (c.after / c.before - 1.0)) if c.before else NONE)
        for c in known.channels
    )  # fmt: skip
    return [
        Heading("Deviation of the measured FRFs before and after the update"),
        *deviation_table(validation),
        Table("The same by FRF", heads, rows, folded=len(rows) > _MOST_UNFOLDED_ROWS),
    ]


def _frf_figures(source: ReportSource, validation: ValidationResults) -> list[Block]:
    """The largest of these FRFs of each configuration, test beside model."""
    figures: list[Block] = []
    for curves in validation.curves:
        panels = _panels(source, curves)
        alt = f"Measured FRFs of {curves.configuration} that the update did not use, and those of the updated model"
        if panels:
            figures.append(Figure(partial(frfs_svg, panels), f"{curves.configuration}, {curves.data}.", alt, wide=True))
    return figures


def _panels(source: ReportSource, curves: PredictedCurves) -> list[FrfPanel]:
    arrays = (source.array(key) for key in (curves.freq_key, curves.values_key, curves.test_values_key))
    lines, model, test = (np.asarray(one) for one in arrays)
    known = np.isfinite(test).any(axis=2)
    largest = np.where(known, np.nanmax(np.where(np.isfinite(test), np.abs(test), 0.0), axis=2), -1.0)
    order = np.argsort(-largest, axis=None)[: min(_MOST_PANELS, int(known.sum()))]
    return [
        FrfPanel(
            f"{curves.outputs[i]} by {curves.inputs[j]}",
            curves.kind,
            (FrfCurve("test", lines, test[i, j]), FrfCurve("after", lines, model[i, j])),
        )
        for i, j in (np.unravel_index(int(k), known.shape) for k in order)
    ]


def _peak_error(r: PredictedResonance) -> str:
    return NONE if r.model_hz is None else signed_percent(100.0 * (r.model_hz / r.test_hz - 1.0))


_TONES: dict[str, Tone] = {"pass": "", "fail": "poor", "not tested": "muted"}


def goodness_sentence(source: ReportSource) -> list[Block]:
    """One sentence, where it was tested."""
    record = _found(source)
    return [] if record is None else [Paragraph(as_sentence(record.sentence), _TONES[record.verdict])]


def goodness(source: ReportSource) -> list[Block]:
    """The sentence, and chi-square by kind."""
    record = _found(source)
    if record is None or not record.by_kind:
        return goodness_sentence(source)
    heads = columns("Residuals", ">Chi-square", ">Degrees of freedom", ">p")
    rows = [row(k.kind, short(k.chi_square), str(k.degrees_of_freedom), _chance(k.p_value)) for k in record.by_kind]
    if len(record.by_kind) > 1:
        rows.append(row("all", short(record.chi_square), str(record.degrees_of_freedom), _chance(record.p_value)))
    note = (
        "p is the probability of at least this chi-square if the residuals are noise with the stated standard "
        f"deviations. The test uses {_tested_part(source)}."
    )
    return [*goodness_sentence(source), Table("Are the residuals noise?", heads, tuple(rows), note)]


def _tested_part(source: ReportSource) -> str:
    update = source.results.update
    if update is None or update.ok:
        return "the part of the residuals that the parameters cannot change"
    return "all of the residuals, because the update ended without an optimum"


def _chance(p: float | None) -> str:
    return NONE if p is None else short(p) if p >= 1e-12 else "< 1e−12"


def _found(source: ReportSource) -> GoodnessResults | None:
    return source.results.update.goodness if source.results.update is not None else None


def criteria(source: ReportSource) -> list[Block]:
    """One table a model version of what was measured; then what was not tested, each reason once."""
    blocks = [table for version in versions(source) if (table := _table(source, version)) is not None]
    blocks += _not_tested(source)
    return [*blocks, *source.after_notes] if blocks else [Paragraph("Not tested: no criterion was evaluated.")]


def _table(source: ReportSource, version: ModelVersion) -> Block | None:
    rows = [
        row(c.configuration, *criterion_cells(criterion))
        for c in source.results.correlations
        if c.stage == version
        for criterion in tested(c.criteria)
    ]
    heads: tuple[Column, ...] = columns("Configuration", "Criterion", ">Required", ">Measured", "Verdict", "Remark")
    return Table(VERSION_WORDS[version].capitalize(), heads, tuple(rows)) if rows else None


def tested(criteria: Iterable[CriterionRecord]) -> list[CriterionRecord]:
    """Criteria with a verdict."""
    return [c for c in criteria if c.verdict != NOT_TESTED]


def untested(criteria: Iterable[CriterionRecord]) -> dict[str, tuple[str, ...]]:
    """Criteria that were not tested, with what they ask, by the reason."""
    reasons: dict[str, tuple[str, ...]] = {}
    for c in criteria:
        if c.verdict == NOT_TESTED:
            reasons[c.remark] = (*reasons.get(c.remark, ()), f"{c.name} {_asked(c)}")
    return reasons


def _not_tested(source: ReportSource) -> list[Block]:
    """Configurations with the same criteria and the same reason share a row; of two versions the last one is shown."""
    groups: dict[tuple[tuple[str, ...], tuple[str, ...], str], list[str]] = {}
    for name in source.results.study.configurations:
        for names, (when, reason) in _of_configuration(source, name).items():
            groups.setdefault((names, tuple(when), reason), []).append(name)
    rows = [
        row(", ".join(where), " and ".join(when), "; ".join(names), reason or NONE)
        for (names, when, reason), where in groups.items()
    ]
    heads = columns("Configurations", "When", "Criteria", "Reason")
    return [Table("Criteria that were not tested", heads, tuple(rows))] if rows else []


def _of_configuration(source: ReportSource, name: str) -> dict[tuple[str, ...], tuple[list[str], str]]:
    """Versions and reason by the criteria; reasons hold numbers that differ from version to version."""
    groups: dict[tuple[str, ...], tuple[list[str], str]] = {}
    for version in versions(source):
        at = source.at(name, version)
        for reason, names in untested(at.criteria if at else ()).items():
            groups[names] = ([*groups.get(names, ([], ""))[0], VERSION_HEADS[version]], reason)
    return groups


def criterion_cells(c: CriterionRecord) -> tuple[Cell, ...]:
    """Name, what is asked, what was measured, verdict and remark."""
    measured = with_unit(value(c.measured), c.unit) if c.measured is not None else NOT_TESTED
    return row(c.name, _asked(c), measured, verdict_cell(c.verdict), c.remark or NONE)


def _asked(c: CriterionRecord) -> str:
    return with_unit(f"{'≤' if c.sense == 'at most' else '≥'} {value(c.limit)}", c.unit)


_NOTHING = "no data were held out of the update, so that the quality of predictions was not tested"


def validation_document(subject: Subject, results: Results) -> Document:
    """Verdicts, predictions, held-out sensors, whether the residuals of the update are noise, what was not tested."""
    validation = results.validation or ValidationResults(predictions=(), not_tested=())
    sentence = outcome_sentence(validation) or _NOTHING
    sections = (
        Section("verdicts", "Verdicts", tuple(validation_verdicts(validation)[1:])),
        Section(
            "predictions", "Predictions", tuple(prediction_blocks(validation, []) if validation.predictions else ())
        ),
        Section("sensors", "Held-out sensors", tuple(sensor_blocks(validation))),
        Section("vibrations", "Vibration tests", tuple(_vibrations(results))),
        Section("residuals", "Residuals of the update", tuple(_residuals(results))),
        Section("open", "What was not tested", (Listing((*untested_reasons(validation), *validation.not_tested)),)),
        *warnings_of(results),
    )
    return subject.document(as_sentence(sentence), _level(validation), sections)


def _vibrations(results: Results) -> Iterable[Block]:
    """The modes of each vibration test that was computed."""
    for test in () if results.validation is None else results.validation.vibrations:
        if sentence := modes_sentence(test):
            yield Paragraph(f"{test.name}:{sentence}")


def _residuals(results: Results) -> list[Block]:
    update = results.update
    if update is None or update.goodness is None:
        return []
    return [Paragraph(as_sentence(update.goodness.sentence), "poor" if update.goodness.verdict == "fail" else "")]


def _level(validation: ValidationResults) -> Level:
    words = {v.verdict for v in validation.verdicts}
    return "problem" if "fail" in words else "info" if words - {NOT_TESTED} else "warning"
