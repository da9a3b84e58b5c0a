"""Sensors on the structure, seen from two sides, with the trace lines of the test."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.document.figures.shapes import (
    VECTOR_FACES,
    Painting,
    View,
    Wireframe,
    closed,
    direction,
    far_to_near,
    fitted,
    mean_over_corners,
    outline,
    painted,
    rastered,
)
from femtune.document.figures.svg import BLUE, INK, ORANGE, PALE, SOFT, label, mixed, number, strokes, svg_file

_PANEL_WIDTH = 590.0
"""Width of a view in points: a page has one view per row, so that names of marks are legible."""
_GAP = 14.0
"""Distance between views in points."""
_TITLE_HEIGHT = 16.0
"""Height of the title of a view in points."""
_MARGIN = 25.0
"""Space around the structure in points, for marks and names at its edge."""
_LEGEND_HEIGHT = 26.0
"""Height of the legend below the views in points."""
_TALLEST_VIEW = 0.75
"""Largest height of a view over its width: both views of a tall structure fit on a page."""
_FACING_SHADE = "#fbfcfd"
"""Colour of faces turned towards the eye: nearly white, so that marks stand out."""
_GRAZING_SHADE = "#ccd5de"
"""Colour of faces along the line of sight; faces between the two are shaded by their slope."""
_EDGE_COLOUR = "#9fadba"
"""Edges of faces."""
_WIRE_COLOUR = "#7a8794"
"""Bars and rigid elements, darker than edges of faces."""
_GREEN = "#2c7a4b"
"""Sensors for visualisation only."""
_RED = "#8c1d40"
"""What is no sensor that is compared."""
TEST_POINT, LEFT_OUT = "test point", "test point that is left out"
"""Kinds of marks for the points of a test on the model."""
COLOURS = {
    "triaxial": BLUE, "uniaxial": ORANGE, "visualisation": _GREEN, "exciter": _RED, TEST_POINT: BLUE, LEFT_OUT: _RED,
}  # fmt: skip
"""Colour of each kind of mark."""
_MARK_RADIUS = 3.4
"""Radius of a mark in points."""
_MOST_NAMES = 80
"""Marks that are named; with more, names hide each other."""


@dataclass(frozen=True, eq=False)
class Marks:
    """What is marked: (n, 3) places, names, kinds (keys of `COLOURS`), and (n, 3) normals, zero where there is none."""

    places: Reals
    names: Sequence[str]
    kinds: Sequence[str]
    normals: Reals


@dataclass(frozen=True)
class TestPoint:
    """A point of a test: its number, its place in the model, and that of its grid point (None if it is left out)."""

    number: int
    place: tuple[float, float, float]
    grid: tuple[float, float, float] | None

    __test__ = False


def sensors_svg(frame: Wireframe, marks: Marks, lines: Sequence[tuple[int, int]]) -> str:
    """The structure from above and from below; sensors on the far side of a surface are drawn hollow.

    Parameters
    ----------
    lines : trace lines, rows of `marks`
    """
    points = np.concatenate([frame.points[frame.used], marks.places])
    above = direction(points)
    views = [("seen from above", above), ("seen from below", _from_below(above))]
    parts, top = [], 0.0
    for title, view in views:
        scaled, height = _scaled(view, points)
        parts.append(f'<g transform="translate(0 {top:.1f})">')
        parts += [label(0.0, 10.0, title, 8.5, SOFT), *_structure(frame, scaled, height + _TITLE_HEIGHT)]
        parts += [*_traces(marks, lines, scaled), *_marks(marks, scaled), "</g>"]
        top += height + _TITLE_HEIGHT + _GAP
    return svg_file(_PANEL_WIDTH, top + _LEGEND_HEIGHT - _GAP, [*parts, *_legend(marks, top - _GAP)])


_STILL_WIDTH = 330.0
"""Width of the single view in points: about half a page of paper, so that names are not made smaller there."""


def still_svg(frame: Wireframe, marks: Marks) -> str:
    """The structure with its marks in one view from above, for half the width of a page."""
    points = np.concatenate([frame.points[frame.used], marks.places])
    scaled, height = _scaled(direction(points), points, _STILL_WIDTH)
    parts = [*_structure(frame, scaled, height + _TITLE_HEIGHT, _STILL_WIDTH), *_marks(marks, scaled)]
    top = height + _TITLE_HEIGHT
    return svg_file(_STILL_WIDTH, top + _LEGEND_HEIGHT, [*parts, *_legend(marks, top)])


def test_points_svg(frame: Wireframe, points: Sequence[TestPoint]) -> str:
    """Test points on the structure, each with a line to its grid point."""
    linked = [one for one in points if one.grid is not None]
    ends = np.array([one.grid for one in linked]).reshape(-1, 3)
    lines = np.arange(len(ends)) + len(frame.points)
    places = np.array([one.place for one in points])
    starts = np.array([one.place for one in linked]).reshape(-1, 3)
    joined = np.column_stack([lines, lines + len(ends)]).reshape(-1, 2)
    drawn = Wireframe(
        np.concatenate([frame.points, starts, ends]),
        np.concatenate([frame.lines.reshape(-1, 2), joined]),
        np.concatenate([frame.rigid, np.zeros(len(ends), bool)]),
        frame.faces,
    )
    kinds = [LEFT_OUT if one.grid is None else TEST_POINT for one in points]
    marks = Marks(places, [str(one.number) for one in points], kinds, np.zeros_like(places))
    return sensors_svg(drawn, marks, ())


def _scaled(view: View, points: Reals, width: float = _PANEL_WIDTH) -> tuple[View, float]:
    """The view in a panel of that width, or in the middle of it where the structure is tall."""
    scaled, height = fitted(view, [points], width, _TITLE_HEIGHT, _MARGIN)
    narrow = min(1.0, _TALLEST_VIEW * width / height)
    scaled, height = fitted(view, [points], narrow * width, _TITLE_HEIGHT, _MARGIN)
    x, y = scaled.shift
    return View(scaled.axes, scaled.scale, (x + 0.5 * (1.0 - narrow) * width, y)), height


def _from_below(view: View) -> View:
    """The same azimuth with the eye below the structure."""
    right, _, eye = view.axes
    down = eye * [1.0, 1.0, -1.0]
    return View(np.array([right, np.cross(down, right), down]))


def _structure(frame: Wireframe, view: View, height: float, width: float = _PANEL_WIDTH) -> Iterable[str]:
    flat, faces = view.flat(frame.points), frame.faces
    if len(faces):
        colours = _shading(frame, view)
        edges = outline(faces, frame.points)
        if len(faces) > VECTOR_FACES:
            yield rastered(_painting(frame, view, edges, colours), (width, height))
        else:
            order = far_to_near(faces, view.depth(frame.points))
            yield painted(flat[closed(faces[order])], [colours[k] for k in order], _EDGE_COLOUR, 0.25, 0.6)
    for rigid in (False, True):
        some = frame.lines[frame.rigid == rigid]
        yield strokes(flat[some[:, 0]], flat[some[:, 1]], _WIRE_COLOUR, 0.6 if rigid else 1.0, "2 2.4" if rigid else "")


def _shading(frame: Wireframe, view: View) -> list[str]:
    at = frame.points[closed(frame.faces)]
    normal = np.cross(at[:, 2] - at[:, 0], at[:, 3] - at[:, 1]) + np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    size = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    towards = np.abs(normal @ view.axes[2]) / size
    shades = [mixed((_GRAZING_SHADE, _FACING_SHADE), k / 15.0) for k in range(16)]
    return [shades[int(k)] for k in np.rint(15.0 * np.clip(towards, 0.0, 1.0))]


def _painting(frame: Wireframe, view: View, edges: NDArray[np.int64], colours: Sequence[str]) -> Painting:
    """Faces without their edges, and the lines that show the form."""
    depth, faces = view.depth(frame.points), frame.faces
    near = 0.6 * float(np.median(np.ptp(depth[closed(faces)], axis=1))) + 1e-3 * float(np.ptp(depth))
    depths = np.concatenate([mean_over_corners(faces, depth), depth[edges].max(axis=1, initial=-np.inf) + near])
    order = np.argsort(depths, kind="stable")
    shown = [*colours, *[_EDGE_COLOUR] * len(edges)]
    line = order >= len(faces)
    corners = view.flat(frame.points)[np.concatenate([closed(faces), edges[:, [0, 1, 1, 0]]])[order]]
    ordered = [shown[k] for k in order]
    return Painting(corners, ordered, ordered, np.where(line, 0.4, 0.0), line)


def _traces(marks: Marks, lines: Sequence[tuple[int, int]], view: View) -> Iterable[str]:
    flat = view.flat(marks.places)
    pairs = np.array(lines, np.int64).reshape(-1, 2)
    yield strokes(flat[pairs[:, 0]], flat[pairs[:, 1]], PALE, 0.7)


def _marks(marks: Marks, view: View) -> Iterable[str]:
    flat, depth = view.flat(marks.places), view.depth(marks.places)
    hidden = marks.normals @ view.axes[2] < -1e-9
    for i in np.argsort(depth, kind="stable"):
        colour = COLOURS[marks.kinds[i]]
        x, y = (float(v) for v in flat[i])
        fill = "#ffffff" if hidden[i] else colour
        yield _sign(marks.kinds[i], x, y, fill, colour)
    if len(marks.names) <= _MOST_NAMES:
        for name, kind, (x, y) in zip(marks.names, marks.kinds, flat):
            yield label(float(x) + 4.6, float(y) - 3.4, name, 6.5, COLOURS[kind])


def _sign(kind: str, x: float, y: float, fill: str, colour: str) -> str:
    """A square for an exciter, a circle for a sensor."""
    style = f'fill="{fill}" stroke="{colour}" stroke-width="1.1"'
    if kind == "exciter":
        left, top, side = number(x - _MARK_RADIUS), number(y - _MARK_RADIUS), 2.0 * _MARK_RADIUS
        return f'<rect x="{left}" y="{top}" width="{side}" height="{side}" {style}/>'
    return f'<circle cx="{number(x)}" cy="{number(y)}" r="{_MARK_RADIUS}" {style}/>'


def _legend(marks: Marks, top: float) -> Iterable[str]:
    x, y = 8.0, top + 0.5 * _LEGEND_HEIGHT
    for kind in dict.fromkeys(marks.kinds):
        yield _sign(kind, x, y, COLOURS[kind], COLOURS[kind])
        yield label(x + 7.0, y + 2.8, kind, 8.0, INK)
        x += 22.0 + 4.6 * len(kind)
    if (marks.normals != 0.0).any():
        yield _sign("uniaxial", x, y, "#ffffff", SOFT)
        yield label(x + 7.0, y + 2.8, "on the far side", 8.0, INK)
