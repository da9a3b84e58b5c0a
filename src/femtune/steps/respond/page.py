"""FRFs before and after beside measured ones, complex modes, static displacements: sections and terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Cell, Column, Figure, Heading, Paragraph, Section, Table, columns, row
from femtune.document.figures.fdac import FdacPanel, fdac_svg
from femtune.document.figures.frfs import FrfCurve, FrfPanel, frfs_svg
from femtune.document.numbers import NONE, counted, freq, percent, short, signed_percent, unit_fraction, value
from femtune.steps.report_source import VERSION_WORDS

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.respond.record import ComplexPole, FrfPair, FrfResults, ResponseResults, StaticResults

_NOTE = (
    "The phase collinearity is 1 if all points move in phase, and lower for complex modes. The difference is "
    "(complex − real)/real."
)
_NEARLY_REAL = 0.95
"""Phase collinearity below which a mode is marked as complex, so that a comparison with real modes is doubtful."""


def complex_modes(source: ReportSource) -> list[Block]:
    """A table each configuration and model version, or why there is none; [] where no FRFs were requested."""
    records = [r for r in source.results.responses if r.frfs is not None]
    return pole_blocks(records)


def pole_blocks(responses: list[ResponseResults]) -> list[Block]:
    """The tables of these records."""
    several = len(responses) > 1
    blocks: list[Block] = []
    for r in responses:
        name = f"{r.configuration}, {VERSION_WORDS[r.stage]}" if several else ""
        if r.poles:
            blocks.append(_table(r, name))
        else:
            words = f"{name or r.configuration}: no complex modes are listed: {r.poles_reason}."
            blocks.append(Paragraph(words, "muted"))
    return blocks


def _table(r: ResponseResults, title: str) -> Table:
    heads = columns(">No.", ">Hz", ">Damping ratio %", ">Phase collinearity", ">Real mode", ">Hz", ">Difference %")
    return Table(title, heads, tuple(_pole_row(i + 1, p) for i, p in enumerate(r.poles)), _NOTE)


def _pole_row(number: int, p: ComplexPole) -> tuple[Cell, ...]:
    ratio = None if p.damping_ratio is None else 100.0 * p.damping_ratio
    if p.kind == "rigid":
        return row(str(number), Cell("rigid body", tone="muted"), NONE, NONE, str(p.real_mode), NONE, NONE)
    if p.kind == "real":
        word = Cell(f"{freq(p.freq_hz)} (no oscillation)", tone="muted")
        return row(str(number), word, percent(ratio), unit_fraction(p.phase_collinearity), NONE, NONE, NONE)
    shown = Cell(unit_fraction(p.phase_collinearity), tone="poor" if p.phase_collinearity < _NEARLY_REAL else "")
    moved = 100.0 * (p.freq_hz / p.real_freq_hz - 1.0) if p.real_freq_hz > 0.0 else None
    difference = NONE if moved is None else signed_percent(moved)
    return row(str(number), freq(p.freq_hz), percent(ratio), shown, str(p.real_mode), freq(p.real_freq_hz), difference)


def static_loads(source: ReportSource) -> list[Block]:
    """A table each configuration and load; [] without loads."""
    return load_blocks(list(source.results.responses), source.results.study.units.partition("-")[0])


def load_blocks(responses: list[ResponseResults], length_unit: str = "") -> list[Block]:
    """The tables of these records; the unit is "" where nobody declares one."""
    names = list(dict.fromkeys(r.configuration for r in responses))
    tables: list[Block] = []
    for name in names:
        versions = [r for r in responses if r.configuration == name]
        tables += [
            _load_table(name, len(names) > 1, [s.loads[k] for s in versions], length_unit)
            for k in range(len(versions[0].loads))
        ]
    return tables


def _load_table(name: str, named: bool, versions: list[StaticResults], unit: str) -> Table:
    last = versions[-1]
    words = ("Displacement",) if len(versions) == 1 else ("Before", "After")
    turns = any("R" in d.output for d in last.displacements)
    shown = f", {unit}{' or rad' if turns else ''}" if unit else ""
    heads = (Column("Output"), *(Column(word + shown, "right") for word in words))
    rows = tuple(
        row(d.output, *(value(s.displacements[i].value, NONE) for s in versions))
        for i, d in enumerate(last.displacements)
    )
    relief = " The structure is unconstrained: inertia relief is applied, and displacements exclude rigid-body motion."
    note = f"Forces: {', '.join(last.forces)}." + (relief if last.inertia_relief else "")
    return Table(f"{name}: {last.load}" if named else last.load, heads, rows, note)


_MOST_PANELS = 6
"""Functions in the figure, the largest ones first: they must stay large enough to be compared."""
_MOST_UNFOLDED_ROWS = 16
"""Rows of the largest table that is shown unfolded: about half a screen."""
_ROUNDING = 1e-12
"""Functions below this part of the largest are not drawn: they are zero but for rounding."""
_CAPTION = "Magnitude (logarithmic) and phase over frequency. The phase is that of motion over force, for e^{iωt}."


def responses(source: ReportSource) -> list[Block]:
    """All of it for the report of a run."""
    if not source.results.responses:
        return [Paragraph("Responses were not computed; the study has neither [response] nor [[load]].", "muted")]
    parts = (("Complex modes", complex_modes(source)), ("Static loads", static_loads(source)))
    more = [block for title, blocks in parts if blocks for block in (Heading(title), *blocks)]
    return [*frequency_responses(source), *more]


def frequency_responses(source: ReportSource) -> list[Block]:
    """Alerts, pictures and the table of all functions, for each configuration."""
    names = list(dict.fromkeys(r.configuration for r in source.results.responses))
    blocks = [b for name in names for b in _configuration(source, name, len(names) > 1)]
    return blocks or [Paragraph("Frequency responses were not computed; the study has no [response].", "muted")]


def responses_of(source: ReportSource, name: str) -> list[ResponseResults]:
    """The responses of a configuration, before and after."""
    return [r for r in source.results.responses if r.configuration == name]


def _configuration(source: ReportSource, name: str, named: bool) -> list[Block]:
    responses = [r for r in responses_of(source, name) if r.frfs is not None]
    if not responses:
        return []
    last = responses[-1].frfs
    assert last is not None
    order = ordered_pairs(last)
    floor = _ROUNDING * max(p.peak for p in last.pairs)
    shown = [k for k in order if last.pairs[k].peak >= floor][:_MOST_PANELS]
    alerts = alert_boxes(a for r in responses for a in r.alerts)
    return [
        *([Heading(name)] if named else []),
        *alerts,
        Paragraph(how(last)),
        _figure(source, responses, shown),
        *([Paragraph(_rest(len(order) - len(shown)), "muted")] if len(order) > len(shown) else []),
        frf_table(responses, order, folded=len(order) > _MOST_UNFOLDED_ROWS),
        *fdac_table(responses),
        *_fdac_figures(source, last),
    ]


_MOST_FDAC_PANELS = 4
"""Pictures of the FDAC, one for each input."""


def fdac_table(responses: Sequence[ResponseResults]) -> list[Block]:
    """Mean FDAC and frequency shift, before and after; [] where it was not computed."""
    frfs = [r.frfs for r in responses if r.frfs is not None]
    if not frfs[-1].fdac:
        return []
    words = ("Model",) if len(frfs) == 1 else ("Before", "After")
    heads = [Column(frfs[-1].fdac[0].axis.capitalize()), Column("Functions", "right")]
    for word in words:
        heads += [Column("FDAC", "right", word), Column("Shift %", "right", word), Column("Shifted", "right", word)]
    rows = tuple(
        row(
            one.dof, str(one.functions),
            *(cell for f in frfs for cell in (
                unit_fraction(f.fdac[k].mean), signed_percent(f.fdac[k].shift_percent),
                unit_fraction(f.fdac[k].mean_shifted),
            )),
        )
        for k, one in enumerate(frfs[-1].fdac)
    )  # fmt: skip
    note = (
        "FDAC, the frequency domain assurance criterion, compares deflection shapes of test and model line by line: "
        "mean at equal frequencies, the frequency shift (model − test)/test with the best agreement, and the mean with "
        "this shift."
    )
    return [Table("Frequency domain assurance criterion", tuple(heads), rows, note)]


def _fdac_figures(source: ReportSource, frfs: FrfResults) -> list[Block]:
    panels = []
    for one in frfs.fdac[:_MOST_FDAC_PANELS]:
        values, test, model = map(source.array, (one.values_key, one.test_freq_key, one.model_freq_key))
        if values is not None and test is not None and model is not None and len(test) > 1 and len(model) > 1:
            panels.append(FdacPanel(f"{one.axis} {one.dof}", values, test, model, one.shift_percent))
    if not panels:
        return []
    caption = "FDAC of test and model. Grey: equal frequencies. Orange: frequency shift with the best agreement."
    alt = "; ".join(f"{p.title}, shift {signed_percent(p.shift_percent)} %" for p in panels)
    return [Figure(partial(fdac_svg, tuple(panels)), caption, f"FDAC, {alt}", wide=True)]


def ordered_pairs(frfs: FrfResults) -> list[int]:
    """Positions of the pairs: driving points first, then measured ones, the largest first."""
    pairs = frfs.pairs

    def rank(k: int) -> tuple[bool, bool, float]:
        return not pairs[k].driving_point, pairs[k].test_peak is None, -pairs[k].peak

    return sorted(range(len(pairs)), key=rank)


def how(frfs: FrfResults) -> str:
    """Kind, way and damping in a sentence."""
    kind = frfs.kind[:1].upper() + frfs.kind[1:]
    modes = "" if frfs.modes is None else f" with {counted(frfs.modes, 'mode')}"
    extra = " and residual vectors" if frfs.residual_vectors else ""
    way = "directly" if frfs.method == "direct" else f"by {frfs.method}"
    error = frfs.truncation_error
    lost = f" Truncation error: {error:.1g} of the values." if error else ""
    return f"{kind}, computed {way}{modes}{extra}.{lost} Damping: {frfs.damping or 'none'}."


def _rest(count: int) -> str:
    return f"{counted(count, 'more function')} {'is' if count == 1 else 'are'} in the table and in arrays.npz."


def _figure(source: ReportSource, responses: Sequence[ResponseResults], shown: Sequence[int]) -> Figure:
    last = responses[-1].frfs
    assert last is not None
    titles = [_title(last.pairs[k]) for k in shown]
    alt = f"Frequency responses of {responses[-1].configuration}: {'; '.join(titles)}"
    return Figure(partial(_draw, source, tuple(responses), tuple(shown)), _CAPTION, alt, wide=True)


def _title(pair: FrfPair) -> str:
    return f"{pair.output} by {pair.input}" + (" (driving point)" if pair.driving_point else "")


def _draw(source: ReportSource, found: tuple[ResponseResults, ...], shown: tuple[int, ...]) -> str:
    return frfs_svg([_panel(source, found, k) for k in shown])


def _panel(source: ReportSource, responses: Sequence[ResponseResults], k: int) -> FrfPanel:
    last = responses[-1].frfs
    assert last is not None
    pair = last.pairs[k]
    looks = ("model",) if len(responses) == 1 else ("before", "after")
    curves = [_curve(source, r.frfs, look, k) for r, look in zip(responses, looks) if r.frfs is not None]
    test = (
        *_test_curve(source, last, k, "test", last.test_freq_key, last.test_values_key),
        *_test_curve(source, last, k, "identified", last.identified_freq_key, last.identified_values_key),
    )
    turns = any("R" in label or "S" in label for label in (pair.output, pair.input))
    unit = f", {last.unit}" if last.unit and not turns else ""
    # the measured curve lies under the model's
    return FrfPanel(_title(pair), f"{last.kind}{unit}", (*curves[:-1], *test, curves[-1]))


def _curve(source: ReportSource, frfs: FrfResults, look: str, k: int) -> FrfCurve:
    values, lines = source.array(frfs.values_key), source.array(frfs.freq_key)
    assert values is not None
    assert lines is not None
    return FrfCurve(look, lines, values[k % len(frfs.outputs), k // len(frfs.outputs)])


def _test_curve(
    source: ReportSource, frfs: FrfResults, k: int, look: str, freq_key: str | None, values_key: str | None
) -> Iterable[FrfCurve]:
    values, lines = source.array(values_key), source.array(freq_key)
    if values is None or lines is None:
        return
    model = source.array(frfs.freq_key)
    assert model is not None
    curve = values[k % len(frfs.outputs), k // len(frfs.outputs)]
    inside = (lines >= model[0]) & (lines <= model[-1])
    if np.isfinite(curve[inside]).any():
        yield FrfCurve(look, lines[inside], curve[inside])


def frf_table(responses: Sequence[ResponseResults], order: Sequence[int], *, folded: bool = False) -> Table:
    """Every function: largest magnitudes and FRAC."""
    frfs = [r.frfs for r in responses if r.frfs is not None]
    words = ("Model",) if len(frfs) == 1 else ("Model before", "Model after")
    measured = any(p.test_peak is not None for p in frfs[-1].pairs)
    heads = [Column("Output"), Column("Input")]
    for word in (*words, *(("Test",) if measured else ())):
        heads += [Column("Hz", "right", word), Column("Largest", "right", word)]
    heads += [Column(word.removeprefix("Model ").capitalize(), "right", "FRAC") for word in words] if measured else []
    rows = tuple(_row(frfs, k, measured) for k in order)
    unit = f" {frfs[-1].unit}," if frfs[-1].unit else ""
    note = f"Largest magnitudes,{unit} rotations in rad." if unit else "Largest magnitudes, in units of the model."
    if measured:
        note += " FRAC, the frequency response assurance criterion, is 1 for proportional functions."
    return Table("All functions", tuple(heads), rows, note, folded)


def _row(frfs: Sequence[FrfResults], k: int, measured: bool) -> tuple[Cell, ...]:
    pairs = [f.pairs[k] for f in frfs]
    last = pairs[-1]
    cells = [c for p in pairs for c in (freq(p.peak_hz), short(p.peak))]
    if measured:
        cells += [freq(last.test_peak_hz), short(last.test_peak), *(unit_fraction(p.frac, NONE) for p in pairs)]
    return row(last.output, last.input, *cells)


def responses_verdict(responses: Sequence[ResponseResults]) -> tuple[str, Level]:
    """How many responses there are, and whether something damps them."""
    functions = sum(len(r.frfs.pairs) for r in responses if r.frfs is not None)
    loads = sum(len(r.loads) for r in responses)
    parts = [counted(functions, "frequency response")] if functions else []
    parts += [counted(loads, "load case")] if loads else []
    what = " and ".join(parts)
    if any(a.code == "response.undamped" for r in responses for a in r.alerts):
        return f"{what}; the model has no damping.", "warning"
    return f"{what}.", "info"


_MOST_ROWS = 24
"""Functions that are listed on the terminal: about a screen; a note gives the number of the others."""


def responses_document(subject: Subject, responses: Sequence[ResponseResults]) -> Document:
    """Peaks of the functions, complex modes, displacements."""
    verdict, level = responses_verdict(responses)
    blocks = [b for r in responses for b in _functions(r, len(responses) > 1)]
    sections = (
        Section("functions", "Frequency responses", tuple(blocks)),
        Section("poles", "Complex modes", tuple(pole_blocks([r for r in responses if r.frfs is not None]))),
        Section("loads", "Static loads", tuple(load_blocks(list(responses), subject.length_unit))),
    )
    return subject.document(verdict, level, sections)


def _functions(r: ResponseResults, named: bool) -> list[Block]:
    if r.frfs is None:
        return []
    order = ordered_pairs(r.frfs)
    name = f"{r.configuration}. " if named else ""
    alerts = alert_boxes(r.alerts)
    more = len(order) - _MOST_ROWS
    rest = [Paragraph(f"and {counted(more, 'more function')} in --json and --report", "muted")] if more > 0 else []
    return [*alerts, Paragraph(name + how(r.frfs)), frf_table([r], order[:_MOST_ROWS]), *fdac_table([r]), *rest]
