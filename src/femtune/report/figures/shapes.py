"""Drawings of mode shapes: undeformed, deformed, and what was measured, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.report.figures.faces import (
    COLOURS,
    STEPS,
    closed,
    far_to_near,
    mean_over_corners,
    outline,
    painted,
    shades,
    silhouette,
)
from femtune.report.figures.labels import cut
from femtune.report.figures.raster import Painting, rastered
from femtune.report.figures.svg import (
    BLUE,
    INK,
    ORANGE,
    PALE,
    SOFT,
    dots,
    label,
    mixed,
    rectangle,
    strokes,
    svg_file,
)  # fmt: skip
from femtune.report.figures.view import View, direction, fitted

Reals = NDArray[np.float64]

VECTOR_FACES = 800
"""Models with more faces are drawn as pixels."""

_PANEL, _GAP, _TITLE, _ACROSS = 205.0, 14.0, 18.0, 3
_ROOM = 0.12
"""Largest motion that is drawn, as a fraction of the structure's diagonal."""
_DASHES = "2 2.4"
_REST, _REST_FILL = "#b6c0ca", "#f1f3f5"
_MARGIN = 5.0
_STRIP, _SCALE = 32.0, (72.0, 6.0)
"""Height of the strip with axes and scale, and size of the scale in it."""


@dataclass(frozen=True)
class Wireframe:
    """The undeformed structure.

    Parameters
    ----------
    points : (n, 3)
    lines : (l, 2) rows of points
    rigid : (l,) True for rigid elements
    faces : (f, 4) rows of points, −1 for the fourth of a triangle
    """

    points: Reals
    lines: NDArray[np.int64]
    rigid: NDArray[np.bool_]
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 4), np.int64))

    @property
    def used(self) -> NDArray[np.int64]:
        """Rows of the points that something is drawn at; all where nothing is."""
        rows = np.unique(np.concatenate([self.lines.ravel(), self.faces.ravel()]))
        return rows[rows >= 0] if rows.size else np.arange(len(self.points))


@dataclass(frozen=True)
class ShapePanel:
    """One mode: motion of the points (n, 3), places (s, 3) of what was measured, and the motion there (s, 3)."""

    title: str
    motion: Reals
    places: Reals = field(default_factory=lambda: np.zeros((0, 3)))
    measured: Reals = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class _Sheet:
    """What all panels share: the structure, its rows in use, and edges of shells that show its form.

    `height` is that of a panel below its title.
    """

    frame: Wireframe
    used: NDArray[np.int64]
    view: View
    height: float
    outline: NDArray[np.int64]

    def factor(self, panel: ShapePanel) -> float:
        """From the motion to the drawn one."""
        return _factor(self.frame, self.used, panel)


def shapes_svg(frame: Wireframe, panels: Sequence[ShapePanel], *, axes: bool = True) -> str:
    """All panels with the same view and the same largest motion; the undeformed structure is in the file once.

    Shells are faces, the farthest first, coloured by their motion; lines are on top of them. Numbers that are not
    finite are drawn as zero. `axes` draws the basic axes, and the scale of colours where there are faces.
    """
    frame, panels = _finite(frame), [_finite_panel(p) for p in panels]
    sheet = _sheet(frame, panels)
    across = min(len(panels), _ACROSS)
    rows = -(-len(panels) // _ACROSS)
    width, tall = across * (_PANEL + _GAP) - _GAP, rows * (sheet.height + _TITLE + _GAP) - _GAP
    parts = ['<defs><g id="rest">', *_rest(sheet), "</g></defs>"]
    for k, panel in enumerate(panels):
        x, y = (k % _ACROSS) * (_PANEL + _GAP), (k // _ACROSS) * (sheet.height + _TITLE + _GAP)
        parts += [f'<g transform="translate({x:.1f} {y:.1f})">', *_panel(sheet, panel), "</g>"]
    if not axes:
        return svg_file(width, tall, parts)
    return svg_file(width, tall + _STRIP, [*parts, *_axes(sheet.view, tall), *_scale(frame, width, tall)])


def _finite(frame: Wireframe) -> Wireframe:
    return Wireframe(_numbers(frame.points), frame.lines, frame.rigid, frame.faces)


def _finite_panel(p: ShapePanel) -> ShapePanel:
    return ShapePanel(p.title, _numbers(p.motion), _numbers(p.places), _numbers(p.measured))


def _numbers(values: Reals) -> Reals:
    return np.where(np.isfinite(values), values, 0.0)


def _sheet(frame: Wireframe, panels: Sequence[ShapePanel]) -> _Sheet:
    """Scale and place of the drawing in a panel, such that every deformed shape fits."""
    used = frame.used
    moved = [(frame.points + _factor(frame, used, p) * p.motion)[used] for p in panels]
    tips = [p.places + _factor(frame, used, p) * p.measured for p in panels]
    rest = frame.points[used]
    parts = [part for part in (rest, *moved, *tips) if len(part)] or [np.zeros((1, 3))]
    view, height = fitted(direction(rest), parts, _PANEL, _TITLE, _MARGIN)
    return _Sheet(frame, used, view, height, outline(frame.faces, frame.points))


def _factor(frame: Wireframe, used: NDArray[np.int64], panel: ShapePanel) -> float:
    if not used.size:
        return 0.0
    diagonal = float(np.linalg.norm(np.ptp(frame.points[used], axis=0)))
    largest = float(np.linalg.norm(panel.motion[used], axis=1).max(initial=0.0))
    return _ROOM * diagonal / largest if largest > 0 else 0.0


def _rest(sheet: _Sheet) -> Iterable[str]:
    frame, flat = sheet.frame, sheet.view.flat(sheet.frame.points)
    edges = sheet.outline
    if len(frame.faces) > VECTOR_FACES:
        yield rastered(_silhouette(flat[closed(frame.faces)], flat[edges]), (_PANEL, sheet.height + _TITLE))
    else:
        yield silhouette(flat[closed(frame.faces)], _REST_FILL)
        yield strokes(flat[edges[:, 0]], flat[edges[:, 1]], _REST, 0.6)
    yield from _wires(frame, flat, _REST)


def _silhouette(faces: Reals, edges: Reals) -> Painting:
    """All faces (f, 4, 2) in one colour, the edges (e, 2, 2) on top."""
    many, few = len(faces), len(edges)
    colours = [_REST_FILL] * many + [_REST] * few
    line = np.arange(many + few) >= many
    return Painting(np.concatenate([faces, edges[:, [0, 1, 1, 0]]]), colours, colours, np.where(line, 0.6, 0.0), line)


def _wires(frame: Wireframe, flat: Reals, colour: str) -> Iterable[str]:
    for rigid in (False, True):
        lines = frame.lines[frame.rigid == rigid]
        width, dashes = (0.6, _DASHES) if rigid else (1.1, "")
        yield strokes(flat[lines[:, 0]], flat[lines[:, 1]], colour, width, dashes)


def _panel(sheet: _Sheet, panel: ShapePanel) -> Iterable[str]:
    frame, view, factor = sheet.frame, sheet.view, sheet.factor(panel)
    moved = frame.points + factor * panel.motion
    yield label(0.0, 10.0, cut(panel.title, 48), 8.5, INK, bold=True)
    yield '<use href="#rest"/>'
    if len(frame.faces):
        yield _faces(sheet, moved, panel.motion)
    # on filled faces lines of their own blue would drown
    yield from _wires(frame, view.flat(moved), INK if len(frame.faces) else BLUE)
    if len(panel.places):
        start, tip = view.flat(panel.places), view.flat(panel.places + factor * panel.measured)
        yield strokes(start, tip, ORANGE, 1.3)
        yield dots(tip, ORANGE, 2.2)


def _faces(sheet: _Sheet, moved: Reals, motion: Reals) -> str:
    faces, view = sheet.frame.faces, sheet.view
    only = np.zeros_like(motion)
    only[sheet.used] = motion[sheet.used]
    scale = [mixed(COLOURS, k / (STEPS - 1)) for k in range(STEPS)]
    colours = [scale[k] for k in shades(faces, only)]
    if len(faces) > VECTOR_FACES:
        painting = _painting(sheet, moved, colours)
        return rastered(painting, (_PANEL, sheet.height + _TITLE))
    order = far_to_near(faces, view.depth(moved))
    corners = view.flat(moved)[closed(faces[order])]
    # edges of small faces would cover them
    side = float(np.sqrt(np.prod(np.ptp(corners.reshape(-1, 2), axis=0) + 1.0) / len(faces)))
    width, opacity = min(0.4, 0.04 * side + 0.08), min(0.55, 0.04 * side + 0.1)
    return painted(corners, [colours[k] for k in order], INK, width, opacity)


def _painting(sheet: _Sheet, moved: Reals, colours: Sequence[str]) -> Painting:
    """Small faces without their edges, and the lines that show the form of the structure between them."""
    lines, faces = sheet.outline, sheet.frame.faces
    both = np.concatenate([closed(faces), lines[:, [0, 1, 1, 0]]])
    depth = sheet.view.depth(moved)
    # a line lies in the faces that it bounds, whose middles may be nearer: it comes after them
    near = 0.6 * float(np.median(np.ptp(depth[closed(faces)], axis=1))) + 1e-3 * float(np.ptp(depth))
    own = np.concatenate([mean_over_corners(faces, depth), depth[lines].max(axis=1, initial=-np.inf) + near])
    order = np.argsort(own, kind="stable")
    edges = [*colours, *[INK] * len(lines)]
    line = order >= len(faces)
    shown = [edges[k] for k in order]
    return Painting(sheet.view.flat(moved)[both[order]], shown, shown, np.where(line, 0.45, 0.0), line)


def _axes(view: View, top: float) -> Iterable[str]:
    """The basic axes, below the panels."""
    origin = np.array([16.0, top + _STRIP - 9.0])
    for name, axis in zip("xyz", View(view.axes, 15.0).flat(np.eye(3))):
        yield strokes(origin[None], (origin + axis)[None], PALE, 0.8)
        x, y = origin + 1.45 * axis
        yield label(x, y + 2.0, name, 6.5, SOFT, "middle")


def _scale(frame: Wireframe, width: float, top: float) -> Iterable[str]:
    """What the colours mean, below the panels on the right; nothing without faces."""
    if not len(frame.faces):
        return
    wide, high = _SCALE
    x, y, cells = width - wide - 52.0, top + 0.5 * _STRIP, 24
    for k in range(cells):
        # a little wider than its share: no gaps between cells
        yield rectangle(x + k * wide / cells, y, wide / cells + 0.3, high, mixed(COLOURS, k / (cells - 1)))
    yield label(x - 4.0, y + 5.4, "no motion", 6.5, SOFT, "end")
    yield label(x + wide + 4.0, y + 5.4, "largest", 6.5, SOFT)
