"""Refusals of solids that have no proper shape."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from femtune.errors import ErrorCollector
from femtune.fem.elements.placement import element_error
from femtune.fem.elements.solid_strains import Reals, SolidFormulation, grid_points
from femtune.fem.structure import ElementBatch, Structure

# two grid points nearer than this part of the element's size are at one place
COLLAPSED = 1e-9
# volume of the box that the sides span, over the product of their lengths, below which they lie in a plane
FLAT = 1e-6
# elements that are shown for each kind of error
SHOWN = 10
# elements that are looked at together
PART = 4096


def check_solids(batch: ElementBatch, structure: Structure, formulation: SolidFormulation) -> None:
    """Refuse what no solid can be made of.

    Raises
    ------
    FemtuneError : ``element.solid-shape`` (two grid points at one place, no volume, corners in the wrong order or
        inverted); several are shown together
    """
    collector, shown = ErrorCollector(), 0
    for start in range(0, len(batch), PART):
        part = slice(start, start + PART)
        xyz = grid_points(batch, structure, part)
        sines = corner_volumes(formulation.jacobians(xyz))
        gaps = nearest_pairs(xyz)
        for i in np.flatnonzero((sines <= FLAT).any(axis=1) | (gaps[0] <= COLLAPSED)):
            if shown == SHOWN:
                break
            shown += 1
            with collector.catch():
                ids = structure.nodes.ids[batch.nodes[start + i]]
                what, hint = _fault(ids, sines[i], gaps[0][i], gaps[1][i], formulation)
                raise element_error(batch, int(start + i), "element.solid-shape", what, hint)
    collector.raise_if_any()


def corner_volumes(jacobians: Reals) -> Reals:
    """(m, k) volume of the box that three sides (m, k, 3, 3) span over the product of their lengths."""
    size = np.prod(np.linalg.norm(jacobians, axis=2), axis=2)
    volume = np.linalg.det(jacobians)
    return np.asarray(np.divide(volume, size, out=np.zeros_like(size), where=size > 0.0))


def nearest_pairs(xyz: Reals) -> tuple[Reals, NDArray[np.int64]]:
    """(m,) smallest distance of two nodes (m, n, 3) over the element's size, and (m, 2) which they are."""
    one, two = np.triu_indices(xyz.shape[1], 1)
    size = (np.nanmax(xyz, axis=1) - np.nanmin(xyz, axis=1)).max(axis=1)
    distance = np.linalg.norm(xyz[:, one] - xyz[:, two], axis=2)
    distance[np.isnan(distance)] = np.inf
    least = distance.argmin(axis=1)
    scale = np.where(size > 0.0, size, 1.0)
    return distance.min(axis=1) / scale, np.stack([one[least], two[least]], axis=1)


def _fault(
    ids: NDArray[np.int64], sines: Reals, gap: float, pair: NDArray[np.int64], formulation: SolidFormulation
) -> tuple[str, str]:
    """What is wrong with an element, and the smallest fix."""
    order = formulation.order
    if gap <= COLLAPSED:
        a, b = pair
        what = f"grid points {ids[a]} and {ids[b]} (places {a + 1} and {b + 1} of the solid) are at the same place"
        return what, "move one of them, or write the solid as the card with fewer corners that it has become"
    if (sines < -FLAT).all():
        return "the corners of the solid are listed the other way around, so that its volume is negative", order
    if (np.abs(sines) <= FLAT).all():
        return "the solid is flat: it has no volume", "move a grid point, or delete the element"
    k = int(sines.argmin())
    where = f"at its corner {k + 1} (grid point {ids[k]})" if k < (formulation.corners or len(ids)) else "in its middle"
    state = "flat" if abs(sines[k]) <= FLAT else "turned inside out"
    return f"the solid is {state} {where}", f"{order}; if they are, move the grid point"
