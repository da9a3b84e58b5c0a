"""Refusals of shells that have no proper shape, thickness or material axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Flags, Reals
from femtune.errors import ErrorCollector
from femtune.fem.elements.placement import element_error, nominal
from femtune.fem.elements.shells.curved_surface import CurvedNodes, CurvedShape, Surface
from femtune.fem.elements.shells.placement import mean_plane, shell_normal
from femtune.fem.elements.solids.checks import nearest_pairs
from femtune.fem.structure import ElementBatch, Structure

# a side shorter than this part of the longest one is collapsed
COLLAPSED = 1e-9
# sine of the angle between two sides at a corner below which the corner is straight or reflex
STRAIGHT = 1e-6
# sine of the angle between the normal and a material direction below which its projection means nothing
ALONG_NORMAL = 1e-6
# elements that are shown for each kind of error
SHOWN = 10


def check_shells(batch: ElementBatch, structure: Structure) -> None:
    """Refuse what no shell can be made of.

    Raises
    ------
    FemtuneError : ``element.shell-shape`` (collapsed side, no area, straight or reflex corner),
        ``element.shell-thickness``, ``element.material-direction``; several are shown together
    """
    collector = ErrorCollector()
    xyz = structure.nodes.xyz[batch.nodes]
    bad = check_thickness(batch, structure, collector) | check_shapes(batch, xyz, collector)
    if not bad.all():
        _check_directions(batch, xyz, ~bad, collector)
    collector.raise_if_any()


def check_thickness(batch: ElementBatch, structure: Structure, collector: ErrorCollector) -> NDArray[np.bool_]:
    """Refuse thicknesses that are not positive (``element.shell-thickness``); (e,) which elements have them."""
    t = nominal(batch, structure, "t")
    bad = ~(t > 0.0)
    for i in np.flatnonzero(bad)[:SHOWN]:
        with collector.catch():
            raise element_error(batch, int(i), "element.shell-thickness", thickness=t[i])
    return bad


def check_shapes(batch: ElementBatch, xyz: Reals, collector: ErrorCollector) -> NDArray[np.bool_]:
    """Refuse corners (e, n, 3) that bound no area (``element.shell-shape``); (e,) which elements have them."""
    side = np.linalg.norm(np.roll(xyz, -1, axis=1) - xyz, axis=2)
    longest = side.max(axis=1)
    collapsed = side.min(axis=1) <= COLLAPSED * longest
    flat = np.linalg.norm(shell_normal(xyz), axis=1) <= STRAIGHT * longest**2
    reflex = np.zeros(len(batch), bool)
    sound = ~(collapsed | flat)
    sines = corner_sines(xyz[sound])
    reflex[sound] = (sines <= STRAIGHT).any(axis=1)
    twice, no_area = "element.shell-shape/collapsed-quadrilateral", "element.shell-shape/no-area-quadrilateral"
    if xyz.shape[1] == 3:
        twice, no_area = "element.shell-shape/collapsed-triangle", "element.shell-shape/no-area-triangle"
    faults = ((collapsed, twice), (flat & ~collapsed, no_area), (reflex, "element.shell-shape/reflex-corner"))
    for mask, code in faults:
        for i in np.flatnonzero(mask)[:SHOWN]:
            with collector.catch():
                raise element_error(batch, int(i), code)
    return np.asarray(collapsed | flat | reflex)


def corner_sines(xyz: Reals) -> Reals:
    """(m, n) sines of the corner angles on the mean plane; negative at a reflex corner."""
    if not len(xyz):
        return np.zeros(xyz.shape[:2])
    corners = mean_plane(xyz)[1]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = ahead[:, :, 0] * back[:, :, 1] - ahead[:, :, 1] * back[:, :, 0]
    sizes = np.linalg.norm(ahead, axis=2) * np.linalg.norm(back, axis=2)
    return np.asarray(np.divide(cross, sizes, out=np.zeros_like(cross), where=sizes > 0.0))


def _check_directions(batch: ElementBatch, xyz: Reals, sound: NDArray[np.bool_], collector: ErrorCollector) -> None:
    direction = batch.facts["direction"]
    given = np.flatnonzero(sound & direction.any(axis=1))
    if not given.size:
        return
    axes = mean_plane(xyz[given])[0]
    flat = np.einsum("mi,mij->mj", direction[given], axes)[:, :2]
    bad = np.linalg.norm(flat, axis=1) <= ALONG_NORMAL * np.linalg.norm(direction[given], axis=1)
    for i in given[bad][:SHOWN]:
        with collector.catch():
            raise element_error(batch, int(i), "element.material-direction")


# ----------------------------------------------------------------------------------------------------
# Refusals of curved shells that have no proper shape, thickness or material axis.


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
            raise element_error(batch, int(at[i]), "element.shell-shape/coincident", grids=(int(one), int(two)))
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
            raise element_error(batch, int(at[i]), "element.shell-shape/folded")
    direction = batch.facts["direction"][at]
    across = np.linalg.norm(np.cross(direction[:, None], surface.cross), axis=2)
    lost = across <= ALONG_NORMAL * np.linalg.norm(direction, axis=1)[:, None] * surface.area
    for i in np.flatnonzero(lost.any(axis=1) & direction.any(axis=1) & ~folded)[:SHOWN]:
        with collector.catch():
            raise element_error(batch, int(at[i]), "element.material-direction")


def _folded(surface: Surface, axes: Reals) -> Flags:
    """(m,) whether the surface folds back at a point; a mid-side node past the quarter of its side folds a corner."""
    size = np.linalg.norm(surface.bases, axis=3).prod(axis=2)
    along = np.einsum("mpi,mi->mp", surface.cross, axes[:, :, 2])
    return np.asarray((along <= STRAIGHT * size.max(axis=1, keepdims=True)).any(axis=1))
