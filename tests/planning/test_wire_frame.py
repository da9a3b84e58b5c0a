"""Sensors for the picture, and trace lines."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from femtune.planning import farthest_points, mesh_distances, trace_lines


def test_farthest_points_fill_the_corners_of_a_square() -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(25)])
    found = farthest_points(points, points[[0]], 3)
    assert {tuple(points[i, :2]) for i in found} == {(4.0, 4.0), (4.0, 0.0), (0.0, 4.0)}
    # without any sensor the first one is the farthest from the centre
    first = farthest_points(points, np.zeros((0, 3)), 1)
    assert np.isclose(np.linalg.norm(points[first[0], :2] - 2.0), np.sqrt(8.0))
    assert len(farthest_points(points[:2], points[:0], 5)) == 2


def test_distances_run_along_the_mesh() -> None:
    # a U of five points: the ends are near each other, but not along the structure
    points = np.array([[0, 0, 0], [0, 3, 0], [1, 3, 0], [1, 0, 0], [9, 9, 9]], float)
    edges = np.array([[0, 1], [1, 2], [2, 3], [1, 0]])
    found = mesh_distances(points, edges, [0, 3, 4])
    np.testing.assert_allclose(found, [[0, 7, np.inf], [7, 0, np.inf], [np.inf, np.inf, 0]])


@pytest.mark.parametrize("seed", range(4))
def test_trace_lines_contain_a_shortest_tree(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(size=(25, 3))
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    lines = trace_lines(distances)
    tree = minimum_spanning_tree(distances).tocoo()
    assert {tuple(sorted(pair)) for pair in zip(tree.row.tolist(), tree.col.tolist())} <= set(lines)
    graph = np.zeros((25, 25))
    graph[tuple(np.array(lines).T)] = 1.0
    assert connected_components(graph, directed=False)[0] == 1


def test_trace_lines_of_a_grid_are_its_sides() -> None:
    x, y = np.meshgrid(np.arange(3.0), np.arange(4.0))
    points = np.column_stack([x.ravel(), y.ravel()])
    distances = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert {round(distances[i, j], 9) for i, j in trace_lines(distances)} == {1.0}
    assert len(trace_lines(distances)) == 3 * 3 + 4 * 2
