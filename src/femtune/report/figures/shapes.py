"""Line drawings of mode shapes: undeformed, deformed, and what was measured, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.report.figures.labels import cut
from femtune.report.figures.svg import BLUE, INK, ORANGE, PALE, SOFT, dots, label, strokes, svg_file

Reals = NDArray[np.float64]

_PANEL, _GAP, _TITLE, _ACROSS = 205.0, 14.0, 18.0, 3
_ROOM = 0.12
"""Largest motion that is drawn, as a fraction of the structure's diagonal."""
_DASHES = "2 2.4"
_REST = "#b6c0ca"
_MARGIN = 5.0
_AZIMUTH, _ELEVATION = np.radians(-58.0), np.radians(24.0)
"""Where the eye is; off the isometric angles, so that corners of a square plan do not hide each other."""


@dataclass(frozen=True)
class Wireframe:
    """The undeformed structure: `points` (n, 3), `lines` (l, 2) rows of points, `rigid` (l,)."""

    points: Reals
    lines: NDArray[np.int64]
    rigid: NDArray[np.bool_]


@dataclass(frozen=True)
class ShapePanel:
    """One mode: motion of the points (n, 3), places (s, 3) of what was measured, and the motion there (s, 3)."""

    title: str
    motion: Reals
    places: Reals
    measured: Reals


@dataclass(frozen=True)
class _View:
    """From basic coordinates to points of a panel."""

    scale: float
    shift: Reals

    def flat(self, points: Reals) -> Reals:
        """(n, 2), y downwards."""
        return _projected(points) * [self.scale, -self.scale] + self.shift


def shapes_svg(frame: Wireframe, panels: Sequence[ShapePanel], *, axes: bool = True) -> str:
    """All panels with the same view and the same largest motion; the undeformed structure is in the file once.

    `axes` draws the basic axes into the first panel.
    """
    view, height = _view(frame, panels)
    across = min(len(panels), _ACROSS)
    rows = -(-len(panels) // _ACROSS)
    width, tall = across * (_PANEL + _GAP) - _GAP, rows * (height + _TITLE + _GAP) - _GAP
    rest = "".join(_wires(frame, view.flat(frame.points), _REST))
    parts = ['<defs><g id="rest">', rest, "</g></defs>"]
    for k, panel in enumerate(panels):
        x, y = (k % _ACROSS) * (_PANEL + _GAP), (k // _ACROSS) * (height + _TITLE + _GAP)
        parts += [f'<g transform="translate({x:.1f} {y:.1f})">', *_panel(frame, panel, view), "</g>"]
    return svg_file(width, tall, [*parts, *(_axes(height + _TITLE) if axes else ())])


def _projected(points: Reals) -> Reals:
    """Orthographic: right and up on the sheet, z of the basic frame upwards."""
    c, s = np.cos(_AZIMUTH), np.sin(_AZIMUTH)
    right = np.array([-s, c, 0.0])
    up = np.array([-np.sin(_ELEVATION) * c, -np.sin(_ELEVATION) * s, np.cos(_ELEVATION)])
    return np.asarray(points @ np.column_stack([right, up]))


def _view(frame: Wireframe, panels: Sequence[ShapePanel]) -> tuple[_View, float]:
    """Scale and place of the drawing in a panel, such that every deformed shape fits, and the height of a panel."""
    used = np.unique(frame.lines)
    moved = [(frame.points + _factor(frame, p) * p.motion)[used] for p in panels]
    tips = [p.places + _factor(frame, p) * p.measured for p in panels]
    flat = _projected(np.concatenate([frame.points[used], *moved, *tips]))
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = high - low
    room = _PANEL - 2 * _MARGIN
    # a line along the direction of view has no size on the sheet
    scale = min(room / max(size[0], 1e-9 * size.max()), 1.25 * room / max(size[1], 1e-9 * size.max()))
    left = 0.5 * (_PANEL - scale * size[0])
    shift = np.array([left - scale * low[0], _TITLE + _MARGIN + scale * high[1]])
    return _View(scale, shift), float(scale * size[1]) + 2 * _MARGIN


def _factor(frame: Wireframe, panel: ShapePanel) -> float:
    """From the motion to the drawn one."""
    used = np.unique(frame.lines)
    diagonal = float(np.linalg.norm(np.ptp(frame.points[used], axis=0)))
    largest = float(np.linalg.norm(panel.motion[used], axis=1).max(initial=0.0))
    return _ROOM * diagonal / largest if largest > 0 else 0.0


def _wires(frame: Wireframe, flat: Reals, colour: str) -> Iterable[str]:
    for rigid in (False, True):
        lines = frame.lines[frame.rigid == rigid]
        width, dashes = (0.6, _DASHES) if rigid else (1.1, "")
        yield strokes(flat[lines[:, 0]], flat[lines[:, 1]], colour, width, dashes)


def _panel(frame: Wireframe, panel: ShapePanel, view: _View) -> Iterable[str]:
    factor = _factor(frame, panel)
    yield label(0.0, 10.0, cut(panel.title, 48), 8.5, INK, bold=True)
    yield '<use href="#rest"/>'
    yield from _wires(frame, view.flat(frame.points + factor * panel.motion), BLUE)
    if len(panel.places):
        start, tip = view.flat(panel.places), view.flat(panel.places + factor * panel.measured)
        yield strokes(start, tip, ORANGE, 1.3)
        yield dots(tip, ORANGE, 2.2)


def _axes(height: float) -> Iterable[str]:
    """The basic axes in the lower left corner of a panel of that height."""
    origin = np.array([16.0, height - 12.0])
    for name, axis in zip("xyz", _projected(np.eye(3)) * [15.0, -15.0]):
        yield strokes(origin[None], (origin + axis)[None], PALE, 0.8)
        x, y = origin + 1.45 * axis
        yield label(x, y + 2.0, name, 6.5, SOFT, "middle")
