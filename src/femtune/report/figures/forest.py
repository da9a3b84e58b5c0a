"""Parameters between their bounds: prior and posterior with their standard deviations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from femtune.report.figures.labels import cut, room
from femtune.report.figures.svg import BLUE, INK, LINE, ORANGE, PALE, SOFT, circle, label, rectangle, stroke, svg_file
from femtune.report.numbers import short, value, with_unit

_ROW, _WIDE = 24.0, 250.0


@dataclass(frozen=True)
class ForestRow:
    """One parameter in its unit; `sd` is None where σ is not given."""

    name: str
    unit: str
    lower: float
    upper: float
    nominal: float
    prior_sd: float | None
    final: float
    sd: float | None
    at_bound: bool

    def place(self, x: float) -> float:
        """0 at the lower bound, 1 at the upper one."""
        return (x - self.lower) / (self.upper - self.lower)


def forest_svg(rows: Sequence[ForestRow]) -> str:
    """A row each parameter, drawn from its lower to its upper bound."""
    left, bottom = room([r.name for r in rows]) + 44.0, 12.0 + _ROW * len(rows)
    parts = [part for i, entry in enumerate(rows) for part in _one(left, 6.0 + _ROW * (i + 0.5), entry)]
    parts += [label(left, bottom + 6.0, "lower bound", anchor="middle")]
    parts += [label(left + _WIDE, bottom + 6.0, "upper bound", anchor="middle")]
    return svg_file(left + _WIDE + 180.0, bottom + 12.0, parts)


def _one(left: float, y: float, entry: ForestRow) -> Iterable[str]:
    yield label(left - 44.0, y + 3.0, cut(entry.name), anchor="end")
    yield stroke(left, y, left + _WIDE, y, LINE, 1.0)
    yield label(left - 4.0, y + 2.5, short(entry.lower), 6.5, SOFT, "end")
    yield label(left + _WIDE + 4.0, y + 2.5, short(entry.upper), 6.5, SOFT)
    if entry.prior_sd is not None:
        yield _span(left, y + 3.4, entry, entry.nominal, entry.prior_sd, PALE)
    nominal, x = left + _WIDE * entry.place(entry.nominal), left + _WIDE * entry.place(entry.final)
    yield stroke(nominal, y, nominal, y + 7.0, INK, 1.0)
    if entry.sd is not None:
        yield _span(left, y - 2.4, entry, entry.final, entry.sd, BLUE)
    yield rectangle(x - 2.5, y - 4.9, 5.0, 5.0, ORANGE) if entry.at_bound else circle(x, y - 2.4, 2.6, BLUE)
    yield label(left + _WIDE + 44.0, y + 2.5, _words(entry), 7.5)


def _span(left: float, y: float, entry: ForestRow, centre: float, sd: float, colour: str) -> str:
    """± one standard deviation, cut where the bounds are."""
    low, high = (min(max(entry.place(centre + s * sd), 0.0), 1.0) for s in (-1, 1))
    return rectangle(left + _WIDE * low, y - 1.5, _WIDE * (high - low), 3.0, colour)


def _words(entry: ForestRow) -> str:
    spread = "at bound" if entry.at_bound else "σ not given" if entry.sd is None else f"± {short(entry.sd)}"
    return with_unit(f"{value(entry.final)} {spread}", "" if entry.sd is None else cut(entry.unit, 12))
