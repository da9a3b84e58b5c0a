"""Checks of the shape, thickness and material axis of shells."""

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

# Limits below which a shell has no defined geometry. They are about the rounding of coordinates with seven to nine
# digits: elements of poor but possible shape pass, and are judged by `element_shapes`.
COINCIDENT_NODES = 1e-9
"""Length of a side, or distance of two grid points, relative to the longest side, up to which they coincide."""
LEAST_CORNER_SINE = 1e-6
"""Sine of the angle between two sides at a corner up to which the corner is straight or reflex."""
LEAST_DIRECTION_SINE = 1e-6
"""Sine of the angle between the normal and a material direction up to which the projection is undefined."""
MOST_SHOWN = 10
"""Number of elements that are shown for each kind of error; a mesh with more has one cause for many."""


def check_shells(batch: ElementBatch, structure: Structure) -> None:
    """Refuse shells without a valid shape, thickness or material axis.

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
    """Refuse thicknesses that are not positive (``element.shell-thickness``); (e,) True for elements that have them."""
    t = nominal(batch, structure, "t")
    bad = ~(t > 0.0)
    for i in np.flatnonzero(bad)[:MOST_SHOWN]:
        with collector.catch():
            raise element_error(batch, int(i), "element.shell-thickness", thickness=t[i])
    return bad


def check_shapes(batch: ElementBatch, xyz: Reals, collector: ErrorCollector) -> NDArray[np.bool_]:
    """Refuse corners (e, n, 3) that bound no area (``element.shell-shape``); (e,) True for elements that have them."""
    side = np.linalg.norm(np.roll(xyz, -1, axis=1) - xyz, axis=2)
    longest = side.max(axis=1)
    collapsed = side.min(axis=1) <= COINCIDENT_NODES * longest
    flat = np.linalg.norm(shell_normal(xyz), axis=1) <= LEAST_CORNER_SINE * longest**2
    reflex = np.zeros(len(batch), bool)
    sound = ~(collapsed | flat)
    sines = corner_sines(xyz[sound])
    reflex[sound] = (sines <= LEAST_CORNER_SINE).any(axis=1)
    twice, no_area = "element.shell-shape/collapsed-quadrilateral", "element.shell-shape/no-area-quadrilateral"
    if xyz.shape[1] == 3:
        twice, no_area = "element.shell-shape/collapsed-triangle", "element.shell-shape/no-area-triangle"
    faults = ((collapsed, twice), (flat & ~collapsed, no_area), (reflex, "element.shell-shape/reflex-corner"))
    for mask, code in faults:
        for i in np.flatnonzero(mask)[:MOST_SHOWN]:
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
    bad = np.linalg.norm(flat, axis=1) <= LEAST_DIRECTION_SINE * np.linalg.norm(direction[given], axis=1)
    for i in given[bad][:MOST_SHOWN]:
        with collector.catch():
            raise element_error(batch, int(i), "element.material-direction")


# ----------------------------------------------------------------------------------------------------
# Checks of the shape, thickness and material axis of curved shells.


ELEMENTS_PER_CHECK = 2048
"""Elements that are checked together: some MB of base vectors and of distances between nodes."""


def check_curved(batch: ElementBatch, structure: Structure, shape: CurvedShape) -> None:
    """Refuse curved shells without a valid shape, thickness or material axis.

    Raises
    ------
    FemtuneError : ``element.shell-shape`` (as of flat shells; coincident grid points, a surface that folds back),
        ``element.shell-thickness``, ``element.material-direction``; several are shown together
    """
    collector = ErrorCollector()
    xyz = np.where((batch.nodes < 0)[:, :, None], np.nan, structure.nodes.xyz[batch.nodes])
    bad = check_thickness(batch, structure, collector) | check_shapes(batch, xyz[:, : shape.corners], collector)
    bad[~bad] = _check_middles(batch, structure, np.flatnonzero(~bad), xyz, collector)
    for at in np.array_split(np.flatnonzero(~bad), max(int((~bad).sum()) // ELEMENTS_PER_CHECK, 1)):
        _check_surface(batch, at, xyz[at], shape, collector)
    collector.raise_if_any()


def _check_middles(
    batch: ElementBatch, structure: Structure, at: NDArray[np.int64], xyz: Reals, collector: ErrorCollector
) -> Flags:
    """Coincident grid points; (m,) True for elements that have them."""
    if not len(at):
        return np.zeros(0, bool)
    gaps, pairs = nearest_pairs(xyz[at])
    for i in np.flatnonzero(gaps <= COINCIDENT_NODES)[:MOST_SHOWN]:
        with collector.catch():
            one, two = structure.nodes.ids[batch.nodes[at[i], pairs[i]]]
            raise element_error(batch, int(at[i]), "element.shell-shape/coincident", grids=(int(one), int(two)))
    return np.asarray(gaps <= COINCIDENT_NODES)


def _check_surface(
    batch: ElementBatch, at: NDArray[np.int64], xyz: Reals, shape: CurvedShape, collector: ErrorCollector
) -> None:
    """Folds and material axes of the elements `at`, whose grid points are at `xyz`, NaN where left out."""
    missing = np.isnan(xyz[:, :, 0])
    nodes = CurvedNodes(shape, np.where(missing[:, :, None], 0.0, xyz), np.zeros_like(xyz), missing)
    surface = nodes.surface(shape.points)
    folded = _folded(surface, nodes.axes) | _folded(nodes.surface(shape.nodes), nodes.axes)
    for i in np.flatnonzero(folded)[:MOST_SHOWN]:
        with collector.catch():
            raise element_error(batch, int(at[i]), "element.shell-shape/folded")
    direction = batch.facts["direction"][at]
    across = np.linalg.norm(np.cross(direction[:, None], surface.cross), axis=2)
    lost = across <= LEAST_DIRECTION_SINE * np.linalg.norm(direction, axis=1)[:, None] * surface.area
    for i in np.flatnonzero(lost.any(axis=1) & direction.any(axis=1) & ~folded)[:MOST_SHOWN]:
        with collector.catch():
            raise element_error(batch, int(at[i]), "element.material-direction")


def _folded(surface: Surface, axes: Reals) -> Flags:
    """(m,) whether the surface folds back at a point; a mid-side node past the quarter of its side folds a corner."""
    size = np.linalg.norm(surface.bases, axis=3).prod(axis=2)
    along = np.einsum("mpi,mi->mp", surface.cross, axes[:, :, 2])
    return np.asarray((along <= LEAST_CORNER_SINE * size.max(axis=1, keepdims=True)).any(axis=1))
