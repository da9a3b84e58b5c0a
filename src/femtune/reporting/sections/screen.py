"""A screening: contributions of the parameters to the variation of the frequencies, F and p, and the modes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from femtune.reporting.alert_boxes import alert_boxes
from femtune.reporting.document import Bar, Cell, Figure, Listing, Table, columns, row
from femtune.reporting.figures.effects import main_effects_svg
from femtune.reporting.numbers import NONE, counted, freq, short, unit_fraction

if TYPE_CHECKING:
    from femtune.reporting.document import Block
    from femtune.reporting.source import ReportSource
    from femtune.results.screen import MainEffect, ScreenedMode, ScreenResults

_MOST_COLUMNS = 12
"""Modes side by side in a table."""
_MOST_DRAWN = 6


def _of(source: ReportSource) -> ScreenResults:
    assert source.results.screen is not None
    return source.results.screen


def _label(found: ScreenResults, mode: ScreenedMode) -> str:
    several = len({m.configuration for m in found.modes}) > 1
    return f"{mode.configuration} {mode.mode}" if several else str(mode.mode)


def _by_place(found: ScreenResults) -> dict[tuple[str, str, int], MainEffect]:
    return {(e.parameter, e.configuration, e.mode): e for e in found.effects}


def screen_summary(source: ReportSource) -> list[Block]:
    """Sentences, what should be known, and the picture."""
    found = _of(source)
    return [*summary_blocks(found), *_picture(found)]


def summary_blocks(found: ScreenResults) -> list[Block]:
    """Sentences and alerts, for page and terminal."""
    alerts = alert_boxes(found.alerts)
    design = f"{found.design}: {counted(found.runs, 'run')}, {found.error_freedom} degrees of freedom for the error."
    return [Listing((*found.sentences, design)), *alerts]


def _picture(found: ScreenResults) -> list[Block]:
    effects, modes = _by_place(found), found.modes[:_MOST_DRAWN]
    changes = [
        [
            [100.0 * (effects[p.name, m.configuration, m.mode].means_hz[k] / m.mean_hz - 1.0) for m in modes]
            for k in range(len(p.values))
        ]
        for p in found.parameters
    ]
    names, labels = [p.name for p in found.parameters], [f"mode {_label(found, m)}" for m in modes]
    draw = partial(main_effects_svg, names, labels, [p.values for p in found.parameters], changes)
    caption = "Mean frequency of the runs of each level, relative to the mean of all runs."
    return [Figure(draw, caption, f"{caption} {'; '.join(found.sentences)}", wide=True)]


def screen_contributions(source: ReportSource) -> list[Block]:
    """A line each parameter, a column each mode."""
    return [contribution_table(_of(source))]


def contribution_table(found: ScreenResults) -> Table:
    """Contributions in %."""
    effects, modes = _by_place(found), found.modes[:_MOST_COLUMNS]
    heads = columns("Parameter", *(f">{_label(found, m)}" for m in modes))
    rows = [
        row(p.name, *(_share(effects[p.name, m.configuration, m.mode].contribution) for m in modes))
        for p in found.parameters
    ]
    rows.append(row("not explained", *(_share(m.error_contribution) for m in modes)))
    left = len(found.modes) - len(modes)
    return Table("", heads, tuple(rows), f"and {counted(left, 'more mode')} in the results" if left else "")


def _share(part: float) -> Cell:
    return Cell(f"{100.0 * part:.1f}", bar=Bar(0.0, min(max(part, 0.0), 1.0)))


def screen_variance(source: ReportSource) -> list[Block]:
    """F, p and range of every effect."""
    found = _of(source)
    modes = {(m.configuration, m.mode): _label(found, m) for m in found.modes}
    heads = columns("Parameter", ">Mode", ">F", ">p", ">Contribution %", ">Range Hz", ">Mean Hz of each level")
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
        for e in found.effects
    )
    return [Table("", heads, rows, folded=len(rows) > 40)]


def screen_modes(source: ReportSource) -> list[Block]:
    """The modes that were followed."""
    return [mode_table(_of(source))]


def mode_table(found: ScreenResults) -> Table:
    """Frequencies, and how well the shapes could be followed."""
    heads = columns("Mode", ">Initial Hz", ">Mean of the runs Hz", ">Smallest MAC", ">Not explained %")
    return Table(
        "",
        heads,
        tuple(
            row(
                _label(found, m), freq(m.freq_hz), freq(m.mean_hz), unit_fraction(m.least_mac),
                f"{100.0 * m.error_contribution:.1f}",
            )
            for m in found.modes
        ),
    )  # fmt: skip
