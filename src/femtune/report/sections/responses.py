"""Frequency responses of the model, before and after the update, beside the measured ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np

from femtune.report.document import AlertBox, Block, Cell, Column, Figure, Heading, Paragraph, Table, row
from femtune.report.figures.frfs import FrfCurve, FrfPanel, frfs_svg
from femtune.report.numbers import NONE, counted, freq, short, unit_fraction
from femtune.report.sections.complex_modes import complex_modes
from femtune.report.sections.static_loads import static_loads
from femtune.report.source import Source
from femtune.study.results_response import FrfPair, FrfResults, ResponseResults

_PANELS = 6
_FOLDED = 16
_ROUNDING = 1e-12
"""Functions below this part of the largest are not drawn: they are zero but for rounding."""
_CAPTION = "Magnitude (logarithmic) and phase over frequency. Phases are those of motion over force, e^{iωt}."


def responses(source: Source) -> list[Block]:
    """All of it for the report of a run."""
    if not source.results.responses:
        return [Paragraph("Responses: not run; a study with [response] or [[load]] has them here.", "muted")]
    parts = (("Complex modes", complex_modes(source)), ("Static loads", static_loads(source)))
    more = [block for title, blocks in parts if blocks for block in (Heading(title), *blocks)]
    return [*frequency_responses(source), *more]


def frequency_responses(source: Source) -> list[Block]:
    """Alerts, pictures and the table of all functions, each configuration by itself."""
    names = list(dict.fromkeys(r.configuration for r in source.results.responses))
    blocks = [b for name in names for b in _configuration(source, name, len(names) > 1)]
    return blocks or [Paragraph("Frequency responses: not run, the study has no [response].", "muted")]


def stages_of(source: Source, name: str) -> list[ResponseResults]:
    """The responses of a configuration, before and after."""
    return [r for r in source.results.responses if r.configuration == name]


def _configuration(source: Source, name: str, named: bool) -> list[Block]:
    found = [r for r in stages_of(source, name) if r.frfs is not None]
    if not found:
        return []
    last = found[-1].frfs
    assert last is not None
    order = ordered_pairs(last)
    floor = _ROUNDING * max(p.peak for p in last.pairs)
    shown = [k for k in order if last.pairs[k].peak >= floor][:_PANELS]
    alerts = dict.fromkeys(AlertBox(a.level, a.code, a.sentence, a.where) for r in found for a in r.alerts)
    return [
        *([Heading(name)] if named else []),
        *alerts,
        Paragraph(how(last)),
        _figure(source, found, shown),
        *([Paragraph(_rest(len(order) - len(shown)), "muted")] if len(order) > len(shown) else []),
        frf_table(found, order, folded=len(order) > _FOLDED),
    ]


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
    return f"{kind}, computed {way}{modes}{extra}. Damping: {frfs.damping or 'none'}."


def _rest(count: int) -> str:
    return f"{counted(count, 'more function')} {'is' if count == 1 else 'are'} in the table and in arrays.npz."


def _figure(source: Source, found: Sequence[ResponseResults], shown: Sequence[int]) -> Figure:
    last = found[-1].frfs
    assert last is not None
    titles = [_title(last.pairs[k]) for k in shown]
    alt = f"Frequency responses of {found[-1].configuration}: {'; '.join(titles)}"
    return Figure(partial(_draw, source, tuple(found), tuple(shown)), _CAPTION, alt, wide=True)


def _title(pair: FrfPair) -> str:
    return f"{pair.output} by {pair.input}" + (" (driving point)" if pair.driving_point else "")


def _draw(source: Source, found: tuple[ResponseResults, ...], shown: tuple[int, ...]) -> str:
    return frfs_svg([_panel(source, found, k) for k in shown])


def _panel(source: Source, found: Sequence[ResponseResults], k: int) -> FrfPanel:
    last = found[-1].frfs
    assert last is not None
    pair = last.pairs[k]
    looks = ("model",) if len(found) == 1 else ("before", "after")
    curves = [_curve(source, r.frfs, look, k) for r, look in zip(found, looks) if r.frfs is not None]
    test = _test_curve(source, last, k)
    turns = any("R" in label or "S" in label for label in (pair.output, pair.input))
    unit = f", {last.unit}" if last.unit and not turns else ""
    # the measured curve lies under the model's
    return FrfPanel(_title(pair), f"{last.kind}{unit}", (*curves[:-1], *test, curves[-1]))


def _curve(source: Source, frfs: FrfResults, look: str, k: int) -> FrfCurve:
    values, lines = source.array(frfs.values_key), source.array(frfs.freq_key)
    assert values is not None
    assert lines is not None
    return FrfCurve(look, lines, values[k % len(frfs.outputs), k // len(frfs.outputs)])


def _test_curve(source: Source, frfs: FrfResults, k: int) -> Iterable[FrfCurve]:
    values, lines = source.array(frfs.test_values_key), source.array(frfs.test_freq_key)
    if values is None or lines is None:
        return
    model = source.array(frfs.freq_key)
    assert model is not None
    curve = values[k % len(frfs.outputs), k // len(frfs.outputs)]
    inside = (lines >= model[0]) & (lines <= model[-1])
    if np.isfinite(curve[inside]).any():
        yield FrfCurve("test", lines[inside], curve[inside])


def frf_table(found: Sequence[ResponseResults], order: Sequence[int], *, folded: bool = False) -> Table:
    """Every function: largest magnitudes and FRAC."""
    frfs = [r.frfs for r in found if r.frfs is not None]
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
        note += " FRAC, the frequency response assurance criterion, is 1 for functions of the same shape."
    return Table("All functions", tuple(heads), rows, note, folded)


def _row(frfs: Sequence[FrfResults], k: int, measured: bool) -> tuple[Cell, ...]:
    pairs = [f.pairs[k] for f in frfs]
    last = pairs[-1]
    cells = [c for p in pairs for c in (freq(p.peak_hz), short(p.peak))]
    if measured:
        cells += [freq(last.test_peak_hz), short(last.test_peak), *(unit_fraction(p.frac, NONE) for p in pairs)]
    return row(last.output, last.input, *cells)
