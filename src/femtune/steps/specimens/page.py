"""Section of the report: parameters and frequencies of nominally identical structures, compared."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.document import Cell, Column, Figure, Listing, Paragraph, Table
from femtune.document.figures.specimens import SpecimenRow, specimens_svg
from femtune.document.numbers import NONE, as_sentence, counted, freq, short, value

if TYPE_CHECKING:
    from femtune.document.document import Block
    from femtune.steps.report_source import ReportSource
    from femtune.steps.specimens.record import SpecimenFrequency, SpecimenParameter, SpecimenResults, SpreadRecord

_MOST_LISTED = 24
"""Parameters in the table and in the pictures; more make the page long without showing more, and are in the results."""
_LEAST_PROBABILITY = 1e-6
"""Probability below which only this limit is shown: the distribution is not known so accurately in its tails."""
_NOTE = (
    "COV is the standard deviation over the specimens relative to the mean. Stated: the standard deviation that the "
    "uncertainty of the values alone would give. p: probability that this uncertainty makes the spread as large, "
    "adjusted for the number of parameters."
)
_NOTE_OF_MODES = (
    "COV: standard deviation over the specimens relative to the mean. p: probability that the uncertainty of the "
    "measured frequencies makes their spread as large, adjusted for the number of modes."
)


def specimens(source: ReportSource) -> list[Block]:
    """Blocks of the report; a sentence where the study has no specimens."""
    record = source.results.specimens
    if record is None:
        return [Paragraph("Not tested: the configurations of the study belong to one structure.")]
    return [*specimen_blocks(record), *_pictures(record), *_frequencies(record)]


def specimen_blocks(record: SpecimenResults) -> list[Block]:
    """Sentences and table of the parameters, for page and terminal."""
    return [Listing(tuple(_sentences(record))), _parameters(record)]


def _sentences(record: SpecimenResults) -> list[str]:
    out = [
        as_sentence(f"the spread of {p.name} is {p.spread.sentence}")
        for p in record.parameters
        if p.individual and p.spread
    ]
    if record.not_calibrated:
        names, one = " and ".join(record.not_calibrated), len(record.not_calibrated) == 1
        out.append(
            f"The update uses no test of {names}: {'its' if one else 'their'} individual parameters have the initial "
            "values, which are left out of mean and COV."
        )
    if record.common is not None:
        out.append(as_sentence(f"common parameters: {record.common.sentence}"))
    out += [
        as_sentence(f"the calibration of {s.specimen} alone did not reach an optimum: {s.message}")
        for s in record.separate
        if not s.ok
    ]
    return out


def _parameters(record: SpecimenResults) -> Table:
    alone = bool(record.separate)
    heads = [Column("Parameter"), Column("Calibration")]
    heads += [Column(title, "right", name) for name in record.specimens for title in ("Value", "± σ")]
    heads += [Column(t, "right") for t in ("Mean", "COV %", "Stated %", "p")]
    rows = []
    for p in record.parameters[:_MOST_LISTED]:
        if p.individual:
            rows.append(_row(p, "joint", p.spread, record.not_calibrated))
        else:
            rows.append(_common_row(p))
        if alone:
            rows.append(_row(p, "separate", None if p.individual else p.spread, record.not_calibrated))
    more = len(record.parameters) - _MOST_LISTED
    note = f"{_NOTE} And {counted(more, 'more parameter')} in the results." if more > 0 else _NOTE
    return Table("Parameters of the specimens", tuple(heads), tuple(rows), note)


def _row(
    p: SpecimenParameter, calibration: str, spread: SpreadRecord | None, initial: tuple[str, ...]
) -> tuple[Cell, ...]:
    cells = [Cell(p.name), Cell(calibration)]
    for v in p.values:
        number, sd, bound = (
            (v.value, v.sd, v.at_bound)
            if calibration == "joint"
            else (v.separate_value, v.separate_sd, v.separate_at_bound)
        )
        if p.individual and v.specimen in initial:
            cells += [Cell(value(number), tone="muted"), Cell("initial", tone="muted")]
        else:
            cells += [Cell(value(number)), Cell("at bound" if bound else short(sd), tone="poor" if bound else "")]
    return (*cells, *_spread(spread))


def _common_row(p: SpecimenParameter) -> tuple[Cell, ...]:
    first = p.values[0]
    rest = [Cell(NONE, tone="muted")] * (2 * len(p.values) - 2)
    sd = Cell("at bound" if first.at_bound else short(first.sd), tone="poor" if first.at_bound else "")
    return (Cell(p.name), Cell("joint, common"), Cell(value(first.value)), sd, *rest, *_spread(None))


def _spread(spread: SpreadRecord | None) -> list[Cell]:
    if spread is None:
        return [Cell("")] * 4
    stated = None if spread.stated_sd is None or not spread.mean else 100.0 * spread.stated_sd / abs(spread.mean)
    return [Cell(value(spread.mean)), Cell(short(spread.cov_percent)), Cell(short(stated)), _p(spread)]


def _p(spread: SpreadRecord | None) -> Cell:
    if spread is None or spread.p_adjusted is None:
        return Cell(NONE, tone="muted")
    words = f"< {short(_LEAST_PROBABILITY)}" if spread.p_adjusted < _LEAST_PROBABILITY else short(spread.p_adjusted)
    return Cell(words, tone="poor" if spread.verdict == "real" else "")


def _pictures(record: SpecimenResults) -> list[Block]:
    """Each individual parameter over the specimens, with its standard deviations."""
    individual = [p for p in record.parameters if p.individual][:_MOST_LISTED]
    if not individual:
        return []
    names = tuple(name for name in record.specimens if name not in record.not_calibrated)
    values = [(p, [v for v in p.values if v.specimen in names]) for p in individual]
    rows = [
        SpecimenRow(p.name, p.unit, tuple(v.value for v in vs), tuple(v.sd for v in vs), p.nominal) for p, vs in values
    ]
    alt = "; ".join(f"{p.name}: " + ", ".join(f"{v.specimen} {value(v.value)}" for v in vs) for p, vs in values)
    caption = "Individual parameters of the specimens with two standard deviations. Dashed: initial value."
    return [Figure(partial(specimens_svg, names, rows), caption, f"{caption} {alt}", wide=True)]


def _frequencies(record: SpecimenResults) -> list[Block]:
    tables: dict[tuple[str, ...], list[SpecimenFrequency]] = {}
    for f in record.frequencies:
        tables.setdefault(f.configurations, []).append(f)
    return [_table_of_modes(record, names, rows) for names, rows in tables.items()]


def _table_of_modes(record: SpecimenResults, names: tuple[str, ...], rows: list[SpecimenFrequency]) -> Table:
    specimens = [m.specimen for m in rows[0].modes]
    measured = any(m.test_hz is not None for f in rows for m in f.modes)
    heads = [Column("Mode")]
    if measured:
        heads += [Column(t, "right", "Test, Hz") for t in (*specimens, "Mean", "COV %", "p")]
    heads += [Column("Initial", "right", "Model, Hz")]
    heads += [Column(t, "right", "Model, Hz") for t in (*specimens, "Mean", "COV %")]
    cells = []
    for f in rows:
        line = [Cell(str(f.mode))]
        if measured:
            line += [Cell(freq(m.test_hz)) for m in f.modes]
            line += [*_mean(f.test), _p(f.test)]
        line += [Cell(freq(f.before_hz)), *(Cell(freq(m.after_hz)) for m in f.modes), *_mean(f.model)]
        cells.append(tuple(line))
    title = f"Frequencies of the specimens: {', '.join(names)}"
    return Table(title, tuple(heads), tuple(cells), _NOTE_OF_MODES if measured else "Modes by their number.")


def _mean(spread: SpreadRecord | None) -> list[Cell]:
    if spread is None:
        return [Cell(NONE, tone="muted")] * 2
    return [Cell(freq(spread.mean)), Cell(short(spread.cov_percent))]
