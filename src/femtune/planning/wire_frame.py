"""The picture of the test: sensors that fill gaps, and trace lines between neighbours along the structure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from femtune.arrays import Reals


def farthest_points(points: Reals, placed: Reals, count: int) -> NDArray[np.int64]:
    """(count,) points, each the one that is farthest from all placed and chosen ones.

    Parameters
    ----------
    points : (n, 3) candidates
    placed : (p, 3) places that are covered; without any, the first point is the farthest from the centre of all

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import farthest_points
    >>> line = np.column_stack([np.arange(11.0), np.zeros(11), np.zeros(11)])
    >>> farthest_points(line, line[:1], 3)
    array([10,  5,  2])
    """
    middle = points.mean(axis=0) if len(points) else np.zeros(3)
    away = np.full(len(points), np.inf)
    for place in placed:
        away = np.minimum(away, np.linalg.norm(points - place, axis=1))
    chosen: list[int] = []
    while len(chosen) < min(count, len(points)):
        open_ = away if np.isfinite(away).all() else np.linalg.norm(points - middle, axis=1)
        best = int(np.argmax(open_))
        chosen.append(best)
        away = np.minimum(away, np.linalg.norm(points - points[best], axis=1))
    return np.array(chosen, np.int64)


def mesh_distances(points: Reals, edges: NDArray[np.int64], rows: Sequence[int]) -> Reals:
    """(k, k) shortest distances along the edges of a mesh between some of its points, inf between separate parts.

    Parameters
    ----------
    points : (n, 3)
    edges : (e, 2) rows of the points at both ends
    rows : k rows of points
    """
    # each edge once: a sparse matrix would add up the lengths of a repeated one
    edges = np.unique(np.sort(edges, axis=1), axis=0)
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    # points at one place are no distance apart, which a sparse graph would take for no edge
    lengths = np.maximum(lengths, 1e-12 * max(float(lengths.max(initial=0.0)), 1e-300))
    graph = sp.csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(points), len(points)))
    return np.asarray(dijkstra(graph, directed=False, indices=list(rows)))[:, list(rows)]


def trace_lines(distances: Reals) -> list[tuple[int, int]]:
    """Pairs of neighbours: no third point is nearer to both than they are to each other.

    These relative neighbours (Toussaint 1980) contain a shortest tree, so that each connected part is in one piece.

    Parameters
    ----------
    distances : (k, k), inf where there is no connection

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.planning import trace_lines
    >>> trace_lines(np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 1.0], [2.0, 1.0, 0.0]]))
    [(0, 1), (1, 2)]
    """
    traces = []
    for i, j in zip(*np.triu_indices(len(distances), 1)):
        d = distances[i, j]
        between = np.maximum(distances[i], distances[j])
        between[[i, j]] = np.inf
        if np.isfinite(d) and not (between < d * (1.0 - 1e-12)).any():
            traces.append((int(i), int(j)))
    return traces
