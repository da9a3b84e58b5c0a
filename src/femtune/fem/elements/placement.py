"""Position of an element: its axes, its lever arms, and the displacement frames of its nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Where
from femtune.fem.structure import ElementBatch, Structure

LEAST_ORIENTATION_SINE = 1e-6
"""Sine of the angle between a bar and its orientation vector up to which plane 1 is undefined.

Coordinates of seven digits make the angle of parallel vectors about this large.
"""
ELEMENTS_PER_CHUNK = 512
"""Elements that are computed together: their 12 × 12 matrices (590 kB) fit in a core's cache."""


def element_error(batch: ElementBatch, i: int, code: str, **facts: Any) -> FemtuneError:
    """An error that names one element of a batch."""
    number = int(batch.ids[i])
    return FemtuneError(code, where=Where(record=f"{batch.card} {number}"), element=number, **facts)


def node_positions(batch: ElementBatch, structure: Structure, k: int) -> Reals:
    """(e, 3) coordinates of every element's node k; the origin for a grounded one."""
    at = batch.nodes[:, k]
    return np.where(at[:, None] >= 0, structure.nodes.xyz[at], 0.0)


def node_frames(batch: ElementBatch, structure: Structure, k: int) -> Reals:
    """(e, 3, 3) displacement frames of every element's node k; the basic frame for a grounded one."""
    at = batch.nodes[:, k]
    return np.where((at >= 0)[:, None, None], structure.nodes.frames[at], np.eye(3))


def line_axes(batch: ElementBatch, start: Reals, end: Reals) -> tuple[Reals, Reals]:
    """Unit vectors from start to end, (e, 3), and the lengths, (e,).

    Raises
    ------
    FemtuneError : ``element.zero-length``
    """
    span = end - start
    length = np.linalg.norm(span, axis=1)
    # coordinates of magnitude s have rounding errors of about 1e-16 s
    size = np.maximum(np.abs(start).max(axis=1, initial=0.0), np.abs(end).max(axis=1, initial=0.0))
    for i in np.flatnonzero(length <= 1e-12 * size):
        raise element_error(batch, int(i), "element.zero-length/of-bar")
    return span / length[:, None], length


def oriented_axes(batch: ElementBatch, x: Reals, v: Reals) -> Reals:
    """(e, 3, 3) element axes as columns: x along the element, plane x-y contains v, z = x × y.

    Raises
    ------
    FemtuneError : ``element.orientation`` if v is zero or along x
    """
    z = np.cross(x, v)
    height, size = np.linalg.norm(z, axis=1), np.linalg.norm(v, axis=1)
    for i in np.flatnonzero(height <= LEAST_ORIENTATION_SINE * size):
        vector = ", ".join(f"{c:.6g}" for c in v[i])
        raise element_error(batch, int(i), "element.orientation", vector=vector)
    z = z / height[:, None]
    return np.stack([x, np.cross(z, x), z], axis=2)


def any_axes(x: Reals) -> Reals:
    """(e, 3, 3) axes as columns, the first being x; the other two are arbitrary."""
    helper = np.eye(3)[np.argmin(np.abs(x), axis=1)]
    y = np.cross(helper, x)
    y /= np.linalg.norm(y, axis=1)[:, None]
    return np.stack([x, y, np.cross(x, y)], axis=2)


def arm_transform(axes: Reals, arm: Reals, frames: Reals) -> Reals:
    """(e, 6, 6) from a node's displacements to those of a rigid arm's end along given axes.

    The end moves by u + θ × arm. `axes` (e, 3, 3) are columns in the basic frame, `arm` (e, 3) is in the basic
    frame, `frames` (e, 3, 3) are the displacement frames of the nodes.
    """
    out = np.zeros((len(axes), 6, 6))
    turn = np.swapaxes(axes, 1, 2)
    out[:, :3, :3] = out[:, 3:, 3:] = turn @ frames
    if arm.any():
        out[:, :3, 3:] = -turn @ cross_matrix(arm) @ frames
    return out


def cross_matrix(r: Reals) -> Reals:
    """(e, 3, 3) matrices of r × from vectors (e, 3)."""
    out = np.zeros((len(r), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -r[:, 2], r[:, 1], -r[:, 0]
    return np.asarray(out - np.swapaxes(out, 1, 2))


def join_ends(a: Reals, b: Reals) -> Reals:
    """(e, 12, 12) block-diagonal transformation from those of the two ends."""
    out = np.zeros((len(a), 12, 12))
    out[:, :6, :6], out[:, 6:, 6:] = a, b
    return out


def outer(g: Reals, h: Reals | None = None) -> Reals:
    """g gᵀ, or the symmetric g hᵀ + h gᵀ, of vectors (e, d)."""
    if h is None:
        return np.asarray(g[:, :, None] * g[:, None, :])
    both = g[:, :, None] * h[:, None, :]
    return np.asarray(both + np.swapaxes(both, 1, 2))


def sum_of_squares(g: Reals) -> Reals:
    """(e, d, d) sums Σ_k g_k g_kᵀ of vectors (e, k, d)."""
    out = np.empty((len(g), g.shape[2], g.shape[2]))
    for i in range(0, len(g), ELEMENTS_PER_CHUNK):
        part = slice(i, i + ELEMENTS_PER_CHUNK)
        np.multiply(g[part, 0, :, None], g[part, 0, None, :], out=out[part])
        for k in range(1, g.shape[1]):
            out[part] += outer(g[part, k])
    return out


def carry(transform: Reals, matrix: Reals) -> Reals:
    """Tᵀ m T for every element, exactly symmetric."""
    out = np.swapaxes(transform, 1, 2) @ matrix @ transform
    return np.asarray(0.5 * (out + np.swapaxes(out, 1, 2)))


def nominal(batch: ElementBatch, structure: Structure, role: str) -> Reals:
    """(e,) values of a role in the deck."""
    return np.asarray(structure.values.values[batch.roles[role]])
