"""Checks of the shape of solids."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import ErrorCollector
from femtune.fem.elements.placement import element_error
from femtune.fem.elements.solids.strains import SolidFormulation, grid_points
from femtune.fem.structure import ElementBatch, Structure

# Limits below which a solid has no defined geometry: about the rounding of coordinates with seven to nine digits
COINCIDENT_NODES = 1e-9
"""Distance of two grid points, relative to the element's size, up to which they coincide."""
LEAST_CORNER_VOLUME = 1e-6
"""Volume spanned by the sides at a corner, relative to the product of their lengths, up to which they are coplanar."""
MOST_SHOWN = 10
"""Number of elements that are shown for each kind of error; a mesh with more has one cause for many."""
ELEMENTS_PER_CHECK = 4096
"""Elements that are checked together: some ten MB of Jacobians and of distances between nodes."""


def check_solids(batch: ElementBatch, structure: Structure, formulation: SolidFormulation) -> None:
    """Refuse solids without a valid shape.

    Raises
    ------
    FemtuneError : ``element.solid-shape`` (coincident grid points, no volume, corners in the wrong order or
        inverted); several are shown together
    """
    collector, shown = ErrorCollector(), 0
    for start in range(0, len(batch), ELEMENTS_PER_CHECK):
        part = slice(start, start + ELEMENTS_PER_CHECK)
        xyz = grid_points(batch, structure, part)
        sines = corner_volumes(formulation.jacobians(xyz))
        gaps = nearest_pairs(xyz)
        for i in np.flatnonzero((sines <= LEAST_CORNER_VOLUME).any(axis=1) | (gaps[0] <= COINCIDENT_NODES)):
            if shown == MOST_SHOWN:
                break
            shown += 1
            with collector.catch():
                ids = structure.nodes.ids[batch.nodes[start + i]]
                code, facts = _fault(ids, sines[i], gaps[0][i], gaps[1][i], formulation)
                raise element_error(batch, int(start + i), code, **facts)
    collector.raise_if_any()


def corner_volumes(jacobians: Reals) -> Reals:
    """(m, k) volume spanned by three sides (m, k, 3, 3), divided by the product of their lengths."""
    size = np.prod(np.linalg.norm(jacobians, axis=2), axis=2)
    volume = np.linalg.det(jacobians)
    return np.asarray(np.divide(volume, size, out=np.zeros_like(size), where=size > 0.0))


def nearest_pairs(xyz: Reals) -> tuple[Reals, NDArray[np.int64]]:
    """(m,) smallest distance of two nodes (m, n, 3) divided by the element's size, and (m, 2) the nodes."""
    one, two = np.triu_indices(xyz.shape[1], 1)
    size = (np.nanmax(xyz, axis=1) - np.nanmin(xyz, axis=1)).max(axis=1)
    distance = np.linalg.norm(xyz[:, one] - xyz[:, two], axis=2)
    distance[np.isnan(distance)] = np.inf
    least = distance.argmin(axis=1)
    scale = np.where(size > 0.0, size, 1.0)
    return distance.min(axis=1) / scale, np.stack([one[least], two[least]], axis=1)


def _fault(
    ids: NDArray[np.int64], sines: Reals, gap: float, pair: NDArray[np.int64], formulation: SolidFormulation
) -> tuple[str, dict[str, Any]]:
    """The fault of an element: error code and facts."""
    order = formulation.order
    if gap <= COINCIDENT_NODES:
        a, b = pair
        return "element.solid-shape/coincident", {
            "grids": (int(ids[a]), int(ids[b])),
            "places": (int(a) + 1, int(b) + 1),
        }
    if (sines < -LEAST_CORNER_VOLUME).all():
        return "element.solid-shape/negative-volume", {"order": order}
    if (np.abs(sines) <= LEAST_CORNER_VOLUME).all():
        return "element.solid-shape/no-volume", {}
    k = int(sines.argmin())
    state = "flat" if abs(sines[k]) <= LEAST_CORNER_VOLUME else "inverted"
    if k < (formulation.corners or len(ids)):
        facts = {"state": state, "corner": k + 1, "grid": int(ids[k]), "order": order}
        return "element.solid-shape/corner", facts
    return "element.solid-shape/middle", {"state": state, "order": order}
