"""Shells in drawings of modes: what covers what, colours, edges that show the form, and odd cases."""

from __future__ import annotations

import base64
import io
import re
import time
from pathlib import Path
from xml.etree import ElementTree

import matplotlib.image
import numpy as np
import pytest

from femtune.document.figures import shapes
from femtune.document.figures.shapes import (
    COLOURS,
    STEPS,
    ShapePanel,
    Wireframe,
    direction,
    far_to_near,
    outline,
    shapes_svg,
)
from femtune.document.figures.shapes import shades as shades_of
from femtune.document.figures.svg import mixed

_SVG = "{http://www.w3.org/2000/svg}"
_CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
_SIDES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]], dtype=np.int64)
"""Bottom, top, front, back, left, right."""


def _frame(points: np.ndarray, faces: np.ndarray, lines: np.ndarray | None = None) -> Wireframe:
    none = np.zeros((0, 2), np.int64)
    chosen = none if lines is None else lines
    return Wireframe(points, chosen, np.zeros(len(chosen), bool), faces)


def _plate(n: int) -> Wireframe:
    """n × n squares in the plane z = 0."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0)))
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    return _frame(np.column_stack([x, y, 0 * x]), faces)


def _wave(frame: Wireframe) -> np.ndarray:
    out = np.zeros_like(frame.points)
    out[:, 2] = np.sin(frame.points[:, 0] * 9.0 / max(1.0, frame.points[:, 0].max()))
    return out


def _drawn(svg: str) -> list[tuple[str, np.ndarray]]:
    """Colour and outline of each face of all panels, in the order of painting."""
    groups = [g for g in ElementTree.fromstring(svg).iter(f"{_SVG}g") if "stroke-linejoin" in g.attrib]
    paths = [p for g in groups for p in g.iter(f"{_SVG}path")]
    return [(p.attrib["fill"], np.array(re.findall(r"-?[\d.]+", p.attrib["d"]), float).reshape(-1, 2)) for p in paths]


def test_near_faces_cover_far_ones() -> None:
    """Of a cube seen from x, −y, z the top, front and right side are painted last."""
    order = far_to_near(_SIDES, direction(_CUBE).depth(_CUBE))
    assert set(order[3:]) == {1, 2, 5}


def test_the_drawing_paints_in_that_order() -> None:
    motion = np.zeros_like(_CUBE)
    drawn = _drawn(shapes_svg(_frame(_CUBE, _SIDES), [ShapePanel("t", motion)]))
    assert len(drawn) == 6
    # the top is the visible face that lies highest on the sheet, where y points downwards
    heights = [corners[:, 1].mean() for _, corners in drawn]
    assert int(np.argmin(heights)) >= 3


def test_colour_is_the_mean_motion_over_the_largest() -> None:
    faces = np.array([[0, 1, 2, 3], [3, 2, 4, -1]])
    motion = np.zeros((5, 3))
    motion[2], motion[4] = [3, 4, 0], [0, 0, -10]
    expected = [5 / 4 / 10, (5 + 10) / 3 / 10]
    np.testing.assert_allclose(shades_of(faces, motion) / (STEPS - 1), expected, atol=0.5 / (STEPS - 1))


def test_colours_grow_darker_evenly_and_stay_one_hue() -> None:
    """So that a grey print and colour-blind readers see the order."""
    channels = np.array([[int(mixed(COLOURS, k / 40)[i : i + 2], 16) for i in (1, 3, 5)] for k in range(41)])
    light = channels @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light) < 0).all()
    assert (channels[:, 0] <= channels[:, 1]).all()
    assert (channels[:, 1] <= channels[:, 2]).all()


def test_edges_that_show_the_form() -> None:
    assert len(outline(_SIDES, _CUBE)) == 12
    plate = _plate(3)
    assert len(outline(plate.faces, plate.points)) == 12
    bent = plate.points.copy()
    bent[:, 2] = np.maximum(bent[:, 0] - 1.0, 0.0)
    # the crease of three sides comes on top of the border
    assert len(outline(plate.faces, bent)) == 15


def test_a_junction_of_three_plates_is_an_edge() -> None:
    points = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, 1, 0], [0, 0, 1], [0, 1, 1]], float)
    faces = np.array([[0, 1, 3, 2], [0, 1, 5, 4], [0, 1, 7, 6]])
    edges = {tuple(e) for e in outline(faces, points)}
    assert (0, 1) in edges
    assert (0, 1) not in {tuple(e) for e in outline(faces[:2], points)}


def test_triangles_have_three_corners_and_no_edge_to_nowhere() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float)
    frame = _frame(points, np.array([[0, 1, 2, -1]]))
    assert {tuple(e) for e in outline(frame.faces, points)} == {(0, 1), (0, 2), (1, 2)}
    ((_, corners),) = _drawn(shapes_svg(frame, [ShapePanel("t", np.zeros((3, 3)))]))
    assert len(np.unique(corners, axis=0)) == 3


def test_bars_lie_on_top_of_shells() -> None:
    frame = _frame(_CUBE, _SIDES, np.array([[0, 7]]))
    panel = re.split(r'<g transform="translate', shapes_svg(frame, [ShapePanel("t", np.zeros_like(_CUBE))]))[1]
    assert panel.rindex('stroke-width="1.1"') > panel.rindex('z" fill=')


def test_the_scale_of_colours_stands_where_there_are_faces() -> None:
    with_faces = shapes_svg(_frame(_CUBE, _SIDES), [ShapePanel("t", _CUBE)])
    without = shapes_svg(_frame(_CUBE, _SIDES[:0], np.array([[0, 1]])), [ShapePanel("t", _CUBE)])
    assert "largest" in with_faces
    assert "largest" not in without
    assert "largest" not in shapes_svg(_frame(_CUBE, _SIDES), [ShapePanel("t", _CUBE)], axes=False)


@pytest.mark.quick(4)
@pytest.mark.parametrize("pixels", [False, True])
@pytest.mark.parametrize("case", ["still", "nan", "one point", "no size", "nothing", "edge on"])
def test_odd_cases_are_drawn_without_nan(case: str, pixels: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shapes, "VECTOR_FACES", 0 if pixels else 800)
    points, faces, motion = _CUBE.copy(), _SIDES, np.zeros_like(_CUBE)
    if case == "nan":
        motion[:] = [np.nan, np.inf, 1.0]
        points[3, 1] = np.nan
    if case == "one point":
        faces = np.zeros((1, 4), np.int64)
    if case == "no size":
        points, motion = np.ones_like(_CUBE), np.ones_like(_CUBE)
    if case == "nothing":
        points, motion, faces = points[:0], motion[:0], faces[:0]
    if case == "edge on":
        points[:] = np.outer(np.arange(8.0), direction(_CUBE).axes[2])
    svg = shapes_svg(_frame(points, faces), [ShapePanel("t", motion)])
    ElementTree.fromstring(svg)
    assert not re.search(r"nan|inf", re.sub(r'href="[^"]*"', "", svg), re.IGNORECASE)


def test_a_still_structure_has_the_colour_of_no_motion() -> None:
    drawn = _drawn(shapes_svg(_frame(_CUBE, _SIDES), [ShapePanel("t", np.zeros_like(_CUBE))]))
    assert {colour for colour, _ in drawn} == {COLOURS[0]}


def _picture(svg: str) -> np.ndarray:
    """(rows, columns, 4) of the last embedded image."""
    data = re.findall(r'href="data:image/png;base64,([^"]*)"', svg)[-1]
    return np.asarray(matplotlib.image.imread(io.BytesIO(base64.b64decode(data)), format="png"))


@pytest.mark.slow
def test_many_faces_become_pixels_small_and_quick() -> None:
    frame = _plate(75)
    panels = [ShapePanel(str(k), _wave(frame)) for k in range(2)]
    shapes_svg(frame, panels[:1])  # matplotlib is loaded once
    begin = time.process_time()
    svg = shapes_svg(frame, panels)
    assert (time.process_time() - begin) / 2 < 1.0
    # the structure at rest is one more, once for all panels
    assert svg.count("data:image/png;base64,") == 3
    # twenty of them in a page, where they are encoded once more
    assert 20 * len(svg) / 2 * 4 / 3 < 5e6
    assert _picture(svg).shape[2] == 4


def test_pixels_show_what_vectors_would(monkeypatch: pytest.MonkeyPatch) -> None:
    """The colour in the middle of each face of the vectors is found in the pixels at the same place."""
    frame = _plate(4)
    panel = [ShapePanel("t", _wave(frame))]
    drawn = _drawn(shapes_svg(frame, panel))
    monkeypatch.setattr(shapes, "VECTOR_FACES", 0)
    svg = shapes_svg(frame, panel)
    pixels = _picture(svg)
    width = float(re.findall(r'<image width="([\d.]+)"', svg)[0])
    seen = 0
    for colour, corners in drawn:
        x, y = corners.mean(axis=0) * pixels.shape[1] / width
        expected = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        seen += bool(np.abs(pixels[int(y), int(x), :3] - expected).max() < 0.02)
    assert seen >= len(drawn) - 1  # faces that others cover may hide their middle


@pytest.mark.slow
def test_the_same_data_give_the_same_bytes() -> None:
    frame = _plate(30)
    panel = [ShapePanel("t", _wave(frame))]
    assert shapes_svg(frame, panel) == shapes_svg(frame, panel)


def test_flat_structures_are_seen_from_higher_up() -> None:
    flat, tall = _CUBE * [4.0, 4.0, 0.1], _CUBE * [1.0, 1.0, 3.0]
    assert direction(flat).axes[2, 2] > direction(tall).axes[2, 2] > 0
    for points in (flat, tall):
        np.testing.assert_allclose(direction(points).axes @ direction(points).axes.T, np.eye(3), atol=1e-12)


def test_hostile_titles_stay_text(tmp_path: Path) -> None:
    svg = shapes_svg(_frame(_CUBE, _SIDES), [ShapePanel('</text><script>x</script>"&', _CUBE)])
    assert "<script" not in svg
    ElementTree.fromstring(svg)
