"""Drawings of mode shapes: undeformed, deformed, and what was measured, side by side."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from femtune._optional import require
from femtune.document.figures.canvas import draw_png
from femtune.document.figures.svg import (  # fmt: skip
    BLUE,
    INK,
    ORANGE,
    PALE,
    SOFT,
    cut,
    dots,
    label,
    mixed,
    number,
    rectangle,
    strokes,
    svg_file,
)

if TYPE_CHECKING:
    from femtune.arrays import Reals

# ----------------------------------------------------------------------------------------------------
# An orthographic view that suits tall and flat structures.


_AZIMUTH = np.radians(-58.0)
"""Azimuth of the eye: not the isometric angle, so that corners of a square plan do not hide each other."""
_LOW_ELEVATION = np.radians(24.0)
"""Elevation of the eye for a tall structure."""
_HIGH_ELEVATION = np.radians(36.0)
"""Elevation of the eye for a flat structure, such as a wing or a plate."""
_TALL = 0.5
"""Height over width from which a structure is tall; flatter ones are seen from higher up in proportion."""


@dataclass(frozen=True)
class View:
    """From basic coordinates to points of a panel; rows of `axes`: right, up, and towards the eye."""

    axes: Reals
    scale: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)

    def flat(self, points: Reals) -> Reals:
        """(n, 2), y downwards."""
        return np.asarray(points @ self.axes[:2].T * [self.scale, -self.scale] + self.shift)

    def depth(self, points: Reals) -> Reals:
        """(…,) larger for points nearer to the eye."""
        return np.asarray(points @ self.axes[2])


def direction(points: Reals) -> View:
    """The direction of view for a structure with points (n, 3); z of the basic coordinate system is upwards."""
    size = np.ptp(points, axis=0) if len(points) else np.zeros(3)
    width = max(size[0], size[1])
    tall = min(1.0, float(size[2]) / (_TALL * width)) if width > 0.0 else 1.0
    return View(_view_axes(_HIGH_ELEVATION + tall * (_LOW_ELEVATION - _HIGH_ELEVATION)))


def _view_axes(elevation: float) -> Reals:
    c, s = np.cos(_AZIMUTH), np.sin(_AZIMUTH)
    up, out = np.sin(elevation), np.cos(elevation)
    return np.array([[-s, c, 0.0], [-up * c, -up * s, out], [out * c, out * s, up]])


def fitted(view: View, parts: Sequence[Reals], width: float, top: float, margin: float) -> tuple[View, float]:
    """The view scaled so that all points fit into a panel of that width, and the height of that panel.

    Parameters
    ----------
    parts : points (n, 3) that must be on the panel
    top : where the panel begins below its title
    margin : left free on all sides
    """
    flat = np.concatenate(parts) @ view.axes[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    size, room = high - low, width - 2 * margin
    # a line along the direction of view, or a single point, has no size on the sheet
    least = 1e-9 * size.max() or 1.0
    scale = float(min(room / max(size[0], least), 1.25 * room / max(size[1], least)))
    left = 0.5 * (width - scale * size[0])
    shift = (float(left - scale * low[0]), float(top + margin + scale * high[1]))
    return View(view.axes, scale, shift), float(scale * size[1]) + 2 * margin


# ----------------------------------------------------------------------------------------------------
# Shells as filled faces, the farthest first, coloured by their motion.


Faces = NDArray[np.int64]

COLOURS = ("#eaf2f8", "#c3d8ea", "#8db6d8", "#4f8cc0", "#1f5a92", "#0b2d52")
"""Colours from no motion to the largest: one hue that darkens steadily, legible in grey prints and for the
colour-blind."""
STEPS = 32
"""Number of distinguishable shades."""
_CREASE = np.cos(np.radians(25.0))
"""Cosine of the angle between two faces from which their common edge is drawn: facets of a curved shell have less."""


def closed(faces: Faces) -> Faces:
    """(faces, 4) with the third corner of triangles repeated, so that all can be handled alike."""
    return np.where(faces < 0, faces[:, [2]], faces)


def far_to_near(faces: Faces, depth: Reals) -> NDArray[np.int64]:
    """Drawing order of the faces from the depth of each point."""
    return np.argsort(mean_over_corners(faces, depth), kind="stable")


def mean_over_corners(faces: Faces, values: Reals) -> Reals:
    """(faces,) mean over the corners of a value of each point."""
    corners = np.where(faces < 0, 0.0, values[faces])
    return np.asarray(corners.sum(axis=1) / (faces >= 0).sum(axis=1))


def shades(faces: Faces, motion: Reals) -> NDArray[np.int64]:
    """(faces,) 0 … STEPS − 1: mean motion of the corners over the largest motion of all points; 0 where none moves."""
    size = np.linalg.norm(motion, axis=1)
    largest = float(size.max(initial=0.0))
    if largest == 0.0:
        return np.zeros(len(faces), np.int64)
    part = mean_over_corners(faces, size) / largest
    return np.clip(np.rint(part * (STEPS - 1)), 0, STEPS - 1).astype(np.int64)


def outline(faces: Faces, points: Reals) -> Faces:
    """(lines, 2) edges that show the form: free ones, creases, and those that other than two faces share."""
    edges, owner = _edges(faces)
    if not len(edges):
        return edges
    distinct, which, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    normal = _normals(faces, points)[owner]
    pairs = np.argsort(which.ravel(), kind="stable")
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    a, b = pairs[first], pairs[np.minimum(first + 1, len(pairs) - 1)]
    smooth = (count == 2) & (np.abs(np.einsum("ij,ij->i", normal[a], normal[b])) > _CREASE)
    return np.asarray(distinct[~smooth])


def _edges(faces: Faces) -> tuple[Faces, NDArray[np.int64]]:
    """All sides of all faces, the smaller row first, and the face of each."""
    four = closed(faces)
    sides = np.stack([four, np.roll(four, -1, axis=1)], axis=2).reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), 4)
    some = sides[:, 0] != sides[:, 1]
    return np.sort(sides[some], axis=1), owner[some]


def _normals(faces: Faces, points: Reals) -> Reals:
    at = points[closed(faces)]
    normal = np.cross(at[:, 2] - at[:, 0], at[:, 3] - at[:, 1])
    flat = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    normal = np.where((faces[:, 3] < 0)[:, None], flat, normal)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None])


def silhouette(corners: Reals, fill: str) -> str:
    """All faces, corners (faces, 4, 2) on the sheet, as one area of one colour; "" without faces."""
    x, y = corners[..., 0], corners[..., 1]
    area = (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
    # all wound alike, so that overlapping faces do not cut holes into each other
    alike = np.where((area < 0.0)[:, None, None], corners[:, ::-1], corners)
    return f'<path d="{"".join(_outlines(alike))}" fill="{fill}"/>' if len(corners) else ""


def painted(corners: Reals, colours: Iterable[str], edge: str, width: float, opacity: float) -> str:
    """Faces in the order given, corners (faces, 4, 2) on the sheet, each with its colour and thin edges."""
    drawn = (f'<path d="{d}" fill="{c}"/>' for d, c in zip(_outlines(corners), colours, strict=True))
    style = f'stroke="{edge}" stroke-width="{width:.3g}" stroke-opacity="{opacity:.3g}" stroke-linejoin="round"'
    return "".join([f"<g {style}>", *drawn, "</g>"])


def _outlines(corners: Reals) -> Iterable[str]:
    for face in corners.tolist():
        (x, y), *rest = face
        # the repeated corner of a triangle adds nothing to its outline
        yield f"M{number(x)} {number(y)}L{' '.join(f'{number(u)} {number(v)}' for u, v in rest)}z"


# ----------------------------------------------------------------------------------------------------
# Faces of large models as pixels: thousands of them take less room than as vectors, and as little time.


if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DOTS_PER_INCH = 170.0
"""Sharp on a screen of nearly twice the usual density, and in print."""
_POINTS_PER_INCH = 72.0
"""Points per inch in SVG and PDF."""


@dataclass(frozen=True)
class Painting:
    """Faces and lines, the farthest first: corners (n, 4, 2) in points, and colours of area and edge of each.

    A line is a face whose corners are its two ends; `smooth` ones have soft edges.
    """

    corners: NDArray[np.float64]
    fills: Sequence[str]
    edges: Sequence[str]
    widths: NDArray[np.float64]
    smooth: NDArray[np.bool_]


def rastered(painting: Painting, size: tuple[float, float]) -> str:
    """The painting as an SVG image of `size` (points) at the origin."""

    def draw(figure: Figure) -> None:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(0.0, size[0])
        axes.set_ylim(size[1], 0.0)
        kind = require("matplotlib.collections").PolyCollection
        style = {
            "facecolors": _rgba(painting.fills),
            "edgecolors": _rgba(painting.edges),
            "linewidths": painting.widths,
            # shades that melt into each other at every edge of a small face would make the file four times as large
            "antialiaseds": painting.smooth,
        }
        axes.add_collection(kind(painting.corners, joinstyle="round", **style), autolim=False)

    data = draw_png(size[0] / _POINTS_PER_INCH, size[1] / _POINTS_PER_INCH, draw, _DOTS_PER_INCH)
    address = "data:image/png;base64," + base64.b64encode(data).decode()
    return f'<image width="{number(size[0])}" height="{number(size[1])}" href="{address}"/>'


def _rgba(colours: Sequence[str]) -> NDArray[np.float64]:
    """(n, 4) of few different colours; matplotlib would read each name by itself."""
    names, which = np.unique(colours, return_inverse=True)
    return np.asarray(require("matplotlib.colors").to_rgba_array(list(names))[which])


VECTOR_FACES = 800
"""Faces up to which a model is drawn as vectors; larger ones are pixels, whose files are smaller."""

_PANEL_WIDTH = 205.0
"""Width of a panel in points."""
_PANELS_PER_ROW = 3
"""Panels side by side; smaller ones would not show the shape in print."""
_GAP = 14.0
"""Distance between panels in points."""
_TITLE_HEIGHT = 18.0
"""Height of the title of a panel in points."""
_MARGIN = 5.0
"""Space around a shape in points."""
_LARGEST_MOTION = 0.12
"""Largest motion that is drawn, as a fraction of the structure's diagonal: clear, and still recognisable."""
_DASHES = "2 2.4"
"""Lengths of dash and gap of rigid elements in points."""
_REST = "#b6c0ca"
"""Lines of the undeformed structure."""
_REST_FILL = "#f1f3f5"
"""Faces of the undeformed structure."""
_STRIP_HEIGHT = 32.0
"""Height of the strip below the panels, with axes and scale of colours, in points."""
_SCALE_SIZE = (72.0, 6.0)
"""Width and height of the scale of colours in points."""


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
        """Rows of the points of all lines and faces; all points if there are none."""
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
class _PanelSheet:
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
    across = min(len(panels), _PANELS_PER_ROW)
    rows = -(-len(panels) // _PANELS_PER_ROW)
    width, tall = across * (_PANEL_WIDTH + _GAP) - _GAP, rows * (sheet.height + _TITLE_HEIGHT + _GAP) - _GAP
    parts = ['<defs><g id="rest">', *_rest(sheet), "</g></defs>"]
    for k, panel in enumerate(panels):
        x, y = (
            (k % _PANELS_PER_ROW) * (_PANEL_WIDTH + _GAP),
            (k // _PANELS_PER_ROW) * (sheet.height + _TITLE_HEIGHT + _GAP),
        )
        parts += [f'<g transform="translate({x:.1f} {y:.1f})">', *_panel(sheet, panel), "</g>"]
    if not axes:
        return svg_file(width, tall, parts)
    return svg_file(width, tall + _STRIP_HEIGHT, [*parts, *_axes(sheet.view, tall), *_scale(frame, width, tall)])


def _finite(frame: Wireframe) -> Wireframe:
    return Wireframe(_numbers(frame.points), frame.lines, frame.rigid, frame.faces)


def _finite_panel(p: ShapePanel) -> ShapePanel:
    return ShapePanel(p.title, _numbers(p.motion), _numbers(p.places), _numbers(p.measured))


def _numbers(values: Reals) -> Reals:
    return np.where(np.isfinite(values), values, 0.0)


def _sheet(frame: Wireframe, panels: Sequence[ShapePanel]) -> _PanelSheet:
    """Scale and place of the drawing in a panel, such that every deformed shape fits."""
    used = frame.used
    moved = [(frame.points + _factor(frame, used, p) * p.motion)[used] for p in panels]
    tips = [p.places + _factor(frame, used, p) * p.measured for p in panels]
    rest = frame.points[used]
    parts = [part for part in (rest, *moved, *tips) if len(part)] or [np.zeros((1, 3))]
    view, height = fitted(direction(rest), parts, _PANEL_WIDTH, _TITLE_HEIGHT, _MARGIN)
    return _PanelSheet(frame, used, view, height, outline(frame.faces, frame.points))


def _factor(frame: Wireframe, used: NDArray[np.int64], panel: ShapePanel) -> float:
    if not used.size:
        return 0.0
    diagonal = float(np.linalg.norm(np.ptp(frame.points[used], axis=0)))
    largest = float(np.linalg.norm(panel.motion[used], axis=1).max(initial=0.0))
    return _LARGEST_MOTION * diagonal / largest if largest > 0 else 0.0


def _rest(sheet: _PanelSheet) -> Iterable[str]:
    frame, flat = sheet.frame, sheet.view.flat(sheet.frame.points)
    edges = sheet.outline
    if len(frame.faces) > VECTOR_FACES:
        yield rastered(
            _silhouette(flat[closed(frame.faces)], flat[edges]), (_PANEL_WIDTH, sheet.height + _TITLE_HEIGHT)
        )
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


def _panel(sheet: _PanelSheet, panel: ShapePanel) -> Iterable[str]:
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


def _faces(sheet: _PanelSheet, moved: Reals, motion: Reals) -> str:
    faces, view = sheet.frame.faces, sheet.view
    only = np.zeros_like(motion)
    only[sheet.used] = motion[sheet.used]
    scale = [mixed(COLOURS, k / (STEPS - 1)) for k in range(STEPS)]
    colours = [scale[k] for k in shades(faces, only)]
    if len(faces) > VECTOR_FACES:
        painting = _painting(sheet, moved, colours)
        return rastered(painting, (_PANEL_WIDTH, sheet.height + _TITLE_HEIGHT))
    order = far_to_near(faces, view.depth(moved))
    corners = view.flat(moved)[closed(faces[order])]
    # edges of small faces would cover them
    side = float(np.sqrt(np.prod(np.ptp(corners.reshape(-1, 2), axis=0) + 1.0) / len(faces)))
    width, opacity = min(0.4, 0.04 * side + 0.08), min(0.55, 0.04 * side + 0.1)
    return painted(corners, [colours[k] for k in order], INK, width, opacity)


def _painting(sheet: _PanelSheet, moved: Reals, colours: Sequence[str]) -> Painting:
    """Small faces without their edges, and the lines that show the form of the structure between them."""
    lines, faces = sheet.outline, sheet.frame.faces
    both = np.concatenate([closed(faces), lines[:, [0, 1, 1, 0]]])
    depth = sheet.view.depth(moved)
    # a line lies in the faces that it bounds, whose middles may be nearer: it comes after them
    near = 0.6 * float(np.median(np.ptp(depth[closed(faces)], axis=1))) + 1e-3 * float(np.ptp(depth))
    depths = np.concatenate([mean_over_corners(faces, depth), depth[lines].max(axis=1, initial=-np.inf) + near])
    order = np.argsort(depths, kind="stable")
    edges = [*colours, *[INK] * len(lines)]
    line = order >= len(faces)
    shown = [edges[k] for k in order]
    return Painting(sheet.view.flat(moved)[both[order]], shown, shown, np.where(line, 0.45, 0.0), line)


def _axes(view: View, top: float) -> Iterable[str]:
    """The basic axes, below the panels."""
    origin = np.array([16.0, top + _STRIP_HEIGHT - 9.0])
    for name, axis in zip("xyz", View(view.axes, 15.0).flat(np.eye(3))):
        yield strokes(origin[None], (origin + axis)[None], PALE, 0.8)
        x, y = origin + 1.45 * axis
        yield label(x, y + 2.0, name, 6.5, SOFT, "middle")


def _scale(frame: Wireframe, width: float, top: float) -> Iterable[str]:
    """What the colours mean, below the panels on the right; nothing without faces."""
    if not len(frame.faces):
        return
    wide, high = _SCALE_SIZE
    x, y, cells = width - wide - 52.0, top + 0.5 * _STRIP_HEIGHT, 24
    for k in range(cells):
        # a little wider than its share: no gaps between cells
        yield rectangle(x + k * wide / cells, y, wide / cells + 0.3, high, mixed(COLOURS, k / (cells - 1)))
    yield label(x - 4.0, y + 5.4, "no motion", 6.5, SOFT, "end")
    yield label(x + wide + 4.0, y + 5.4, "largest", 6.5, SOFT)
