"""Line drawings of modes: what is measured lies on what is computed where the two are equal."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from femtune.document.document import Document, Figure
from femtune.document.figures.shapes import ShapePanel, Wireframe, shapes_svg
from femtune.steps.report.build import build_report
from femtune.steps.results import Results

_SVG = "{http://www.w3.org/2000/svg}"
_CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_EDGES = np.array([[i, j] for i in range(8) for j in range(i) if np.abs(_CUBE[i] - _CUBE[j]).sum() == 1])
_NOWHERE = np.zeros((0, 3))


def _blocks(document: Document) -> tuple[Any, ...]:
    return next(s for s in document.sections if s.id == "mode_shapes").blocks


def _first(document: Document) -> Figure:
    return next(b for b in _blocks(document) if isinstance(b, Figure))


def _said(document: Document) -> str:
    return " ".join(getattr(b, "text", "") for b in _blocks(document))


def _strokes(group: Any, colour: str) -> np.ndarray:
    found = [p.attrib["d"] for p in group.iter(f"{_SVG}path") if p.attrib["stroke"] == colour]
    return np.array([float(t) for d in found for t in re.findall(r"-?[\d.]+", d)]).reshape(-1, 2)


def _groups(svg: str) -> list[Any]:
    return [g for g in ElementTree.fromstring(svg).iter(f"{_SVG}g") if "transform" in g.attrib]


def test_each_paired_mode_has_its_drawing_and_title(document: Document) -> None:
    first = _first(document)
    titles = [t.text for g in _groups(first.svg) for t in g.iter(f"{_SVG}text")]
    assert titles[0] == "1: 3.127 Hz (test 3.12), MAC 0.999"
    assert len(titles) == 5
    assert "3.127 Hz" in first.alt


def test_measured_motion_lies_on_the_computed_one(document: Document) -> None:
    """The test's shapes of the fixture are three times the model's at the sensors, rotations among them."""
    for group in _groups(_first(document).svg):
        tips = np.array([[float(c.attrib["cx"]), float(c.attrib["cy"])] for c in group.iter(f"{_SVG}circle")])
        assert len(tips) == 5  # the centre and four corners tied to it
        blue = _strokes(group, "#1f5a92")
        assert np.linalg.norm(tips[:, None] - blue[None], axis=2).min(axis=1).max() < 0.2


def test_the_structure_at_rest_is_in_the_file_once(document: Document) -> None:
    svg = _first(document).svg
    assert svg.count("<defs>") == 1
    assert svg.count('<use href="#rest"/>') == 5


def test_everything_drawn_is_on_the_sheet(document: Document) -> None:
    svg = _first(document).svg
    width, height = map(float, re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)[0])
    for group in _groups(svg):
        x, y = map(float, re.findall(r"[\d.]+", group.attrib["transform"]))
        at = _strokes(group, "#1f5a92") + np.array([x, y])
        assert at.min() >= 0.0
        assert (at <= [width, height]).all()


def test_the_view_is_orthographic_with_z_upright() -> None:
    """Parallel edges of equal length stay parallel and equal."""
    svg = shapes_svg(Wireframe(_CUBE, _EDGES, np.zeros(12, bool)), [ShapePanel("", 0 * _CUBE, _NOWHERE, _NOWHERE)])
    ends = _strokes(ElementTree.fromstring(svg), "#b6c0ca").reshape(12, 2, 2)
    drawn, along = ends[:, 1] - ends[:, 0], _CUBE[_EDGES[:, 1]] - _CUBE[_EDGES[:, 0]]
    for axis in range(3):
        assert np.ptp(drawn[np.abs(along[:, axis]) > 0.5], axis=0).max() < 0.25
    assert np.abs(drawn[np.abs(along[:, 2]) > 0.5][:, 0]).max() < 0.15


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_straight_structure_is_drawn(axis: int) -> None:
    points = np.outer(np.arange(5.0), np.eye(3)[axis])
    frame = Wireframe(points, np.array([[i, i + 1] for i in range(4)]), np.zeros(4, bool))
    svg = shapes_svg(frame, [ShapePanel("t", np.roll(points, 1, axis=1), _NOWHERE, _NOWHERE)])
    assert "nan" not in svg
    assert len(_strokes(_groups(svg)[0], "#1f5a92")) == 8


def test_large_models_draw_the_first_modes_and_say_so(slim: dict[str, Any], arrays: dict[str, Any]) -> None:
    lines = arrays["shapes/BC/lines"]
    arrays["shapes/BC/lines"] = np.tile(lines, (700, 1))
    arrays["shapes/BC/line_kinds"] = np.zeros(700 * len(lines), int)
    assert "3 more paired modes are not drawn" in _said(build_report(Results.model_validate(slim), arrays))


def test_a_test_without_shapes_is_said(slim: dict[str, Any], arrays: dict[str, Any]) -> None:
    slim["mode_shapes"][0]["test_shapes_key"] = None
    assert "the test has no mode shapes" in _said(build_report(Results.model_validate(slim), arrays))
