"""How the update went: objective and parameters by iteration."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, LINE, PALE, circle, label, polyline, stroke, svg_file
from femtune.report.numbers import short

_LEFT, _WIDE, _ROOM = 52.0, 340.0, 100.0
_UPPER, _GAP = 125.0, 14.0
_DASHES = ("", "5 2.5", "5 2 1 2", "1.2 2")
_SHADES = ("#1d2733", "#3f4a55", "#5b6977", "#76828e", "#8f9aa5")


def convergence_svg(
    iterations: Sequence[int],
    objective: Sequence[float],
    names: Sequence[str],
    places: Sequence[Sequence[float]],
    events: Sequence[int],
) -> str:
    """Objective in % above, parameters between their bounds below.

    Parameters
    ----------
    places : an entry each iteration, with each parameter's place between its bounds, 0 to 1
    events : iterations after which the pairing changed
    """
    first, span = iterations[0], max(iterations[-1] - iterations[0], 1)
    x = [_LEFT + _WIDE * (i - first) / span for i in iterations]
    top = 8.0 + _UPPER + _GAP
    bottom = top + max(140.0, 11.0 * len(names))
    marks = [_LEFT + _WIDE * (e - first) / span for e in events]
    parts = [stroke(e, 8.0, e, bottom, PALE, 1.0, "1.2 2.4") for e in marks]
    parts += [*_objective(x, objective), *_parameters(x, names, np.array(places, dtype=float), top, bottom)]
    step = max(1, -(-span // 12))
    for i in range(first, first + span + 1, step):
        parts.append(label(_LEFT + _WIDE * (i - first) / span, bottom + 16.0, str(i), anchor="middle"))
    parts.append(label(_LEFT + _WIDE / 2, bottom + 29.0, "iteration", anchor="middle"))
    return svg_file(_LEFT + _WIDE + _ROOM, bottom + 34.0, parts)


def _objective(x: Sequence[float], objective: Sequence[float]) -> Iterable[str]:
    step = _round_step(1.1 * max([*objective, 1e-12]) / 4)
    high = step * np.ceil(max([*objective, 1e-12]) / step)
    base = 8.0 + _UPPER
    for k in range(round(high / step) + 1):
        y = base - _UPPER * k * step / high
        yield stroke(_LEFT, y, _LEFT + _WIDE, y, LINE, 0.6)
        yield label(_LEFT - 5.0, y + 3.0, short(k * step), anchor="end")
    points = [(a, base - _UPPER * v / high) for a, v in zip(x, objective, strict=True)]
    yield polyline(points, BLUE, 1.4)
    yield from (circle(*p, 2.2, BLUE) for p in points)
    yield label(12.0, base - _UPPER / 2, "mean error in %", anchor="middle", turned=True)


def _round_step(least: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is not less."""
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= least * (1 - 1e-12)))


def _parameters(
    x: Sequence[float], names: Sequence[str], places: np.ndarray, top: float, bottom: float
) -> Iterable[str]:
    low, high = bottom - 6.0, top + 6.0
    for y, text in ((high, "upper bound"), (low, "lower bound")):
        yield stroke(_LEFT, y, _LEFT + _WIDE, y, LINE, 0.6)
        yield label(_LEFT - 5.0, y + 3.0, text.split()[0], anchor="end")
        yield label(_LEFT - 5.0, y + 12.0, text.split()[1], anchor="end")
    heights = low + (high - low) * places.reshape(len(x), len(names))
    apart = _apart(heights[-1], 10.0, low)
    for k, name in enumerate(names):
        points = list(zip(x, heights[:, k].tolist()))
        yield polyline(points, _SHADES[k % 5], 1.2, _DASHES[k % 4])
        yield stroke(x[-1] + 2.0, points[-1][1], x[-1] + 13.0, apart[k], PALE, 0.5)
        yield label(x[-1] + 16.0, apart[k] + 2.5, cut(name, 18), 7.0)


def _apart(heights: np.ndarray, gap: float, lowest: float) -> np.ndarray:
    """Heights moved so that neighbours keep `gap`, in their order, none below `lowest` where there is room."""
    order = np.argsort(heights, kind="stable")
    placed = heights[order].copy()
    for i in range(1, len(placed)):
        placed[i] = max(placed[i], placed[i - 1] + gap)
    placed -= max(0.0, float(placed[-1] - lowest)) if len(placed) else 0.0
    for i in range(len(placed) - 2, -1, -1):
        placed[i] = min(placed[i], placed[i + 1] - gap)
    out = np.empty_like(placed)
    out[order] = placed
    return out
