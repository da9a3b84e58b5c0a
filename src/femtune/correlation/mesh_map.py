"""Points that two meshes of one structure have in common: grid points that are each other's nearest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Integers, Reals
from femtune.errors import FemtuneError


@dataclass(frozen=True, eq=False)
class MeshMap:
    """Pairs of grid points.

    Parameters
    ----------
    first, second : (n,) rows of the points of each mesh
    distance : (n,) between them
    """

    first: Integers
    second: Integers
    distance: Reals


def map_meshes(first: Reals, second: Reals, tolerance: float, most: int) -> MeshMap:
    """Pairs of points of two meshes, no point in two of them.

    Parameters
    ----------
    first, second : (n, 3) and (m, 3) coordinates
    tolerance : largest distance of a pair
    most : number of pairs from which those are chosen that are spread best over the structure

    Raises
    ------
    FemtuneError : ``correlate.no-common-points`` for fewer than three pairs

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.correlation.mesh_map import map_meshes
    >>> line = np.linspace(0.0, 1.0, 5)[:, None] * [1.0, 0.0, 0.0]
    >>> found = map_meshes(line, line[[4, 2, 0]] + [0.0, 0.0, 0.01], tolerance=0.02, most=100)
    >>> found.first, found.second, found.distance
    (array([0, 2, 4]), array([2, 1, 0]), array([0.01, 0.01, 0.01]))
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  slow to import, and wanted here alone

    if tolerance < 0.0 or most < _LEAST_POINTS:
        raise FemtuneError("correlate.no-common-points/options", tolerance=tolerance, most=most)
    if not len(first) or not len(second):
        raise FemtuneError("correlate.no-common-points/empty")
    distance, nearest = cKDTree(second).query(first)
    back = cKDTree(first).query(second)[1]
    mutual = back[nearest] == np.arange(len(first))
    near = np.flatnonzero(mutual & (distance <= tolerance))
    if len(near) < _LEAST_POINTS:
        facts = {"tolerance": tolerance, "nearest points": np.sort(distance[mutual])[:_LEAST_POINTS].max()}
        raise FemtuneError("correlate.no-common-points", values=facts, count=len(near))
    chosen = near[_spread(first[near], most)]
    return MeshMap(chosen, nearest[chosen], distance[chosen])


_LEAST_POINTS = 3
"""Common points that fix a rigid motion."""


def _spread(points: Reals, count: int) -> Integers:
    """Ascending positions of points, each chosen as the farthest from those before it."""
    if len(points) <= count:
        return np.arange(len(points))
    chosen = [int(np.argmax(np.sum((points - points.mean(axis=0)) ** 2, axis=1)))]
    away = np.sum((points - points[chosen[0]]) ** 2, axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.sum((points - points[chosen[-1]]) ** 2, axis=1))
    return np.sort(chosen)
