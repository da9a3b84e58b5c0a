"""Shells as filled faces: the farthest first, coloured by how much they move."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from femtune.report.figures.svg import number

Reals = NDArray[np.float64]
Faces = NDArray[np.int64]

COLOURS = ("#eaf2f8", "#c3d8ea", "#8db6d8", "#4f8cc0", "#1f5a92", "#0b2d52")
"""From no motion to the largest: one hue, ever darker, so that grey prints and colour-blind readers show the order."""
STEPS = 32
"""Shades that are told apart."""
_CREASE = np.cos(np.radians(25.0))


def closed(faces: Faces) -> Faces:
    """(faces, 4) with the third corner of triangles repeated, so that all can be handled alike."""
    return np.where(faces < 0, faces[:, [2]], faces)


def far_to_near(faces: Faces, depth: Reals) -> NDArray[np.int64]:
    """Order in which faces cover each other, from the depth of each point."""
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
    found, which, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    normal = _normals(faces, points)[owner]
    pairs = np.argsort(which.ravel(), kind="stable")
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    a, b = pairs[first], pairs[np.minimum(first + 1, len(pairs) - 1)]
    smooth = (count == 2) & (np.abs(np.einsum("ij,ij->i", normal[a], normal[b])) > _CREASE)
    return np.asarray(found[~smooth])


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
