"""Refusals of curved shells that have no proper shape, thickness or material axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector
from femtune.fem.elements.curved_shape import CurvedShape, Reals
from femtune.fem.elements.curved_surface import CurvedNodes, Surface
from femtune.fem.elements.placement import element_error
from femtune.fem.elements.shell_checks import ALONG_NORMAL, COLLAPSED, SHOWN, STRAIGHT, check_shapes, check_thickness
from femtune.fem.elements.solid_checks import nearest_pairs
from femtune.fem.structure import ElementBatch, Structure

Flags = NDArray[np.bool_]

# elements that are looked at together
PART = 2048


def check_curved(batch: ElementBatch, structure: Structure, shape: CurvedShape) -> None:
    """Refuse what no curved shell can be made of.

    Raises
    ------
    FemtuneError : ``element.shell-shape`` (as of flat shells; two grid points at one place, a surface that folds back),
        ``element.shell-thickness``, ``element.material-direction``; several are shown together
    """
    collector = ErrorCollector()
    xyz = np.where((batch.nodes < 0)[:, :, None], np.nan, structure.nodes.xyz[batch.nodes])
    bad = check_thickness(batch, structure, collector) | check_shapes(batch, xyz[:, : shape.corners], collector)
    bad[~bad] = _check_middles(batch, structure, np.flatnonzero(~bad), xyz, collector)
    for at in np.array_split(np.flatnonzero(~bad), max(int((~bad).sum()) // PART, 1)):
        _check_surface(batch, at, xyz[at], shape, collector)
    collector.raise_if_any()


def _check_middles(
    batch: ElementBatch, structure: Structure, at: NDArray[np.int64], xyz: Reals, collector: ErrorCollector
) -> Flags:
    """Grid points at one place; (m,) which of the elements have them."""
    if not len(at):
        return np.zeros(0, bool)
    gaps, pairs = nearest_pairs(xyz[at])
    for i in np.flatnonzero(gaps <= COLLAPSED)[:SHOWN]:
        with collector.catch():
            one, two = structure.nodes.ids[batch.nodes[at[i], pairs[i]]]
            what = f"grid points {one} and {two} of the shell are at the same place"
            raise element_error(batch, int(at[i]), "element.shell-shape", what, "move one of them")
    return np.asarray(gaps <= COLLAPSED)


def _check_surface(
    batch: ElementBatch, at: NDArray[np.int64], xyz: Reals, shape: CurvedShape, collector: ErrorCollector
) -> None:
    """Folds and material axes of the elements `at`, whose grid points are at `xyz`, NaN where left out."""
    missing = np.isnan(xyz[:, :, 0])
    nodes = CurvedNodes(shape, np.where(missing[:, :, None], 0.0, xyz), np.zeros_like(xyz), missing)
    surface = nodes.surface(shape.points)
    folded = _folded(surface, nodes.axes) | _folded(nodes.surface(shape.nodes), nodes.axes)
    for i in np.flatnonzero(folded)[:SHOWN]:
        with collector.catch():
            what = "the surface of the shell folds back or leans by 90 degrees and more from its corners' mean plane"
            hint = "keep mid-side grid points within the middle half of their sides, in the card's order, or split it"
            raise element_error(batch, int(at[i]), "element.shell-shape", what, hint)
    direction = batch.facts["direction"][at]
    across = np.linalg.norm(np.cross(direction[:, None], surface.cross), axis=2)
    lost = across <= ALONG_NORMAL * np.linalg.norm(direction, axis=1)[:, None] * surface.area
    for i in np.flatnonzero(lost.any(axis=1) & direction.any(axis=1) & ~folded)[:SHOWN]:
        with collector.catch():
            what = "the x axis of the material's coordinate system is along the shell's normal"
            hint = "choose a system whose x axis has a projection on the element, or give an angle THETA"
            raise element_error(batch, int(at[i]), "element.material-direction", what, hint)


def _folded(surface: Surface, axes: Reals) -> Flags:
    """(m,) whether the surface folds back at a point; a mid-side node past the quarter of its side folds a corner."""
    size = np.linalg.norm(surface.bases, axis=3).prod(axis=2)
    along = np.einsum("mpi,mi->mp", surface.cross, axes[:, :, 2])
    return np.asarray((along <= STRAIGHT * size.max(axis=1, keepdims=True)).any(axis=1))
