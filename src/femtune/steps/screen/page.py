"""A screening: effects of the parameters on the frequencies (main, elementary, or Sobol's indices), and the modes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.document.alert_boxes import alert_boxes
from femtune.document.document import Bar, Cell, Figure, Listing, Section, Table, columns, row
from femtune.document.figures.effects import beside_svg, main_effects_svg
from femtune.document.numbers import NONE, counted, freq, short, unit_fraction

if TYPE_CHECKING:
    from femtune.document.document import Block, Document, Level
    from femtune.steps.report_source import ReportSource, Subject
    from femtune.steps.screen.record import ElementaryEffect, MainEffect, ScreenedMode, ScreenResults, SobolIndices


_MOST_COLUMNS = 12
"""Modes side by side in a table; more do not fit the width of a page."""
_MOST_DRAWN = 6
"""Modes in the figure: they must stay large enough to be compared."""


def _of(source: ReportSource) -> ScreenResults:
    assert source.results.screen is not None
    return source.results.screen


def _label(screening: ScreenResults, mode: ScreenedMode) -> str:
    if mode.response:
        return mode.response
    several = len({m.configuration for m in screening.modes}) > 1
    return f"{mode.configuration} {mode.mode}" if several else str(mode.mode)


def _value_label(screening: ScreenResults, mode: ScreenedMode) -> str:
    """With its unit where the rows have several units."""
    mixed = any(m.response for m in screening.modes) and not mode.response
    return f"mode {_label(screening, mode)}, Hz" if mixed else _label(screening, mode)


def _by_place(screening: ScreenResults) -> dict[tuple[str, str, int], MainEffect]:
    return {(e.parameter, e.configuration, e.mode): e for e in screening.effects}


def screen_summary(source: ReportSource) -> list[Block]:
    """Sentences, what should be known, and the picture."""
    screening = _of(source)
    return [*summary_blocks(screening), *(_picture(screening) if screening.effects else _beside(screening))]


def summary_blocks(screening: ScreenResults) -> list[Block]:
    """Sentences and alerts, for page and terminal."""
    alerts = alert_boxes(screening.alerts)
    freedom = "" if screening.error_freedom is None else f", {screening.error_freedom} degrees of freedom for the error"
    design = f"{screening.design}: {counted(screening.runs, 'run')}{freedom}."
    return [Listing((*screening.sentences, design)), *alerts]


def _picture(screening: ScreenResults) -> list[Block]:
    effects, modes = _by_place(screening), screening.modes[:_MOST_DRAWN]
    changes = [
        [
            [100.0 * (effects[p.name, m.configuration, m.mode].means_hz[k] / m.mean_hz - 1.0) for m in modes]
            for k in range(len(p.values))
        ]
        for p in screening.parameters
    ]
    names = [p.name for p in screening.parameters]
    labels = [m.response or f"mode {_label(screening, m)}" for m in modes]
    draw = partial(main_effects_svg, names, labels, [p.values for p in screening.parameters], changes)
    caption = "Mean frequency of the runs of each level, relative to the mean of all runs."
    return [Figure(draw, caption, f"{caption} {'; '.join(screening.sentences)}", wide=True)]


def _beside(screening: ScreenResults) -> list[Block]:
    """Elementary effects or Sobol's indices of the first modes."""
    modes = screening.modes[:_MOST_DRAWN]
    labels = [f"mode {_label(screening, m)}" for m in modes]
    if screening.elementary:
        legend, unit = ("μ*, with 95 % interval", "σ"), "Hz"
        caption = "Elementary effects: mean absolute change over the range of each parameter, and standard deviation."
        values = {(e.parameter, e.configuration, e.mode): _morris(e) for e in screening.elementary}
    else:
        legend, unit = ("first", "total"), "part of the variance"
        caption = "Sobol's indices with 95 % intervals: alone, and with all interactions."
        values = {(s.parameter, s.configuration, s.mode): _sobol(s) for s in screening.indices}
    names = [p.name for p in screening.parameters]
    panels = [[values[name, m.configuration, m.mode] for name in names] for m in modes]
    draw = partial(beside_svg, names, labels, panels, legend, unit)
    return [Figure(draw, caption, f"{caption} {'; '.join(screening.sentences)}", wide=True)]


_Ranges = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Two values, each with its lower and upper limit."""


def _morris(effect: ElementaryEffect) -> _Ranges:
    wide, spread = effect.absolute_margin_hz or 0.0, effect.spread_hz or 0.0
    value = effect.absolute_hz
    return (value, max(value - wide, 0.0), value + wide), (spread, spread, spread)


def _sobol(indices: SobolIndices) -> _Ranges:
    return (indices.first, *indices.first_interval), (indices.total, *indices.total_interval)


def screen_elementary(source: ReportSource) -> list[Block]:
    """μ, μ* and σ of every parameter and mode."""
    return elementary_table(_of(source))


def elementary_table(screening: ScreenResults) -> list[Block]:
    """The same, for page and terminal."""
    heads = columns("Parameter", ">Mode", ">μ Hz", ">μ* Hz", ">± 95 %", ">σ Hz", ">σ / μ*")
    modes = _labels(screening)
    rows = tuple(
        row(
            e.parameter, modes[e.configuration, e.mode], short(e.mean_hz), short(e.absolute_hz),
            short(e.absolute_margin_hz), short(e.spread_hz),
            NONE if e.spread_hz is None or not e.absolute_hz else f"{e.spread_hz / e.absolute_hz:.2f}",
        )
        for e in screening.elementary
    )  # fmt: skip
    return [Table("", heads, rows, folded=len(rows) > 40)] if rows else []


def screen_indices(source: ReportSource) -> list[Block]:
    """First and total indices of every parameter and mode."""
    return indices_table(_of(source))


def indices_table(screening: ScreenResults) -> list[Block]:
    """The same, for page and terminal."""
    heads = columns("Parameter", ">Mode", ">First", ">95 %", ">Total", ">95 %")
    modes = _labels(screening)
    rows = tuple(
        row(
            s.parameter, modes[s.configuration, s.mode], f"{s.first:.3f}", _limits(s.first_interval),
            Cell(f"{s.total:.3f}", bar=Bar(0.0, min(max(s.total, 0.0), 1.0))), _limits(s.total_interval),
        )
        for s in screening.indices
    )  # fmt: skip
    return [Table("", heads, rows, folded=len(rows) > 40)] if rows else []


def _limits(interval: tuple[float, float]) -> str:
    return f"{interval[0]:.3f} to {interval[1]:.3f}"


def _labels(screening: ScreenResults) -> dict[tuple[str, int], str]:
    return {(m.configuration, m.mode): _label(screening, m) for m in screening.modes}


def screen_contributions(source: ReportSource) -> list[Block]:
    """A line each parameter, a column each mode."""
    return contribution_table(_of(source))


def contribution_table(screening: ScreenResults) -> list[Block]:
    """Contributions in %, of main effects."""
    if not screening.effects:
        return []
    effects, modes = _by_place(screening), screening.modes[:_MOST_COLUMNS]
    heads = columns("Parameter", *(f">{_label(screening, m)}" for m in modes))
    rows = [
        row(p.name, *(_share(effects[p.name, m.configuration, m.mode].contribution) for m in modes))
        for p in screening.parameters
    ]
    rows.append(row("not explained", *(_share(m.error_contribution or 0.0) for m in modes)))
    left = len(screening.modes) - len(modes)
    return [Table("", heads, tuple(rows), f"and {counted(left, 'more mode')} in the results" if left else "")]


def _share(part: float) -> Cell:
    return Cell(f"{100.0 * part:.1f}", bar=Bar(0.0, min(max(part, 0.0), 1.0)))


def screen_variance(source: ReportSource) -> list[Block]:
    """F, p and range of every effect."""
    screening = _of(source)
    modes = _labels(screening)
    # other values have their own units
    of, hz = ("Value", "") if any(m.response for m in screening.modes) else ("Mode", " Hz")
    heads = columns("Parameter", f">{of}", ">F", ">p", ">Contribution %", f">Range{hz}", f">Mean{hz} of each level")
    rows = tuple(
        row(
            e.parameter,
            modes[e.configuration, e.mode],
            short(e.f_value),
            NONE if e.p_value is None else f"{e.p_value:.2g}",
            f"{100.0 * e.contribution:.2f}",
            short(e.range_hz),
            ", ".join(freq(hz) for hz in e.means_hz),
        )
        for e in screening.effects
    )
    return [Table("", heads, rows, folded=len(rows) > 40)] if rows else []


def screen_modes(source: ReportSource) -> list[Block]:
    """The modes that were followed."""
    return [mode_table(_of(source))]


def mode_table(screening: ScreenResults) -> Table:
    """Frequencies, how well the shapes could be followed, and other values of a finished table in their own units."""
    heads = columns("Mode", ">Initial Hz", ">Mean of the runs Hz", ">Smallest MAC", ">Not explained %")
    if any(m.response for m in screening.modes):
        heads = columns(
            "Value", ">Nearest to the initial values", ">Mean of the runs", ">Smallest MAC", ">Not explained %"
        )
    return Table(
        "",
        heads,
        tuple(
            row(
                _value_label(screening, m), freq(m.freq_hz), freq(m.mean_hz), unit_fraction(m.least_mac, NONE),
                NONE if m.error_contribution is None else f"{100.0 * m.error_contribution:.1f}",
            )
            for m in screening.modes
        ),
    )  # fmt: skip


def screen_verdict(screening: ScreenResults) -> tuple[str, Level]:
    """The first sentence of a screening."""
    level: Level = "warning" if any(a.level != "info" for a in screening.alerts) else "info"
    return f"{screening.design}, {counted(screening.runs, 'run')}. {screening.sentences[0]}", level


def screen_document(subject: Subject, screening: ScreenResults) -> Document:
    """Sentences, effects and modes."""
    verdict, level = screen_verdict(screening)
    parts = (
        ("screen", "Effects of the parameters", summary_blocks(screening)),
        ("contributions", "Contribution to the variation in %", contribution_table(screening)),
        ("elementary", "Elementary effects", elementary_table(screening)),
        ("indices", "Sobol's indices", indices_table(screening)),
        ("modes", "Modes", [mode_table(screening)]),
    )
    sections = tuple(Section(name, title, tuple(blocks)) for name, title, blocks in parts if blocks)
    return subject.document(verdict, level, sections)
