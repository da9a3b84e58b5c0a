"""DOFs without stiffness are found, those with little are not."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from femtune.fem.assemble import assemble
from femtune.fem.singularities import empty_dofs, singular_dofs
from femtune.fem.structure import NodeTable
from structures.frames import bars, make_structure, rods, scalars

SECTION = {"E": 200.0, "G": 80.0, "A": 3.0, "I1": 0.7, "I2": 0.4, "J": 0.9, "rho": 2.0}


def found(structure, held=()) -> set[int]:
    K = assemble(structure, "stiffness").tocsr()
    free = np.setdiff1d(np.arange(structure.nodes.n_dofs), list(held))
    return set(singular_dofs(sp.csr_array(K[free][:, free]), free, structure.nodes).tolist())


def test_rod_leaves_what_is_not_along_it():
    structure = make_structure([[0, 0, 0], [2.0, 0, 0]], [rods([[0, 1]], {**SECTION, "J": 0.0})])
    assert found(structure) == {1, 2, 3, 4, 5, 7, 8, 9, 10, 11}


def test_held_dofs_are_not_reported():
    structure = make_structure([[0, 0, 0], [2.0, 0, 0]], [rods([[0, 1]], SECTION)])
    assert found(structure, [*range(6), 7]) == {8, 10, 11}


def test_skew_rods_leave_the_component_nearest_to_their_normal():
    """Three rods in the plane with normal (0, 0.28, 0.96) at one node: its z is held, x and y are not."""
    xyz = [[0, 0, 0], [1.0, 0, 0], [0, 0.96, -0.28], [1.0, 0.96, -0.28]]
    structure = make_structure(xyz, [rods([[0, 1], [0, 2], [0, 3]], {**SECTION, "J": 0.0})])
    assert {d for d in found(structure, range(6, 24)) if d < 3} == {2}


def test_single_skew_rod_keeps_its_main_component():
    structure = make_structure([[0, 0, 0], [0.3, 2.0, 0.2]], [rods([[0, 1]], {**SECTION, "J": 0.0})])
    assert {d for d in found(structure, range(6, 12)) if d < 3} == {0, 2}


def test_beam_without_torsion():
    structure = make_structure([[0, 0, 0], [2.0, 0, 0]], [bars([[0, 1]], {**SECTION, "J": 0.0})])
    assert found(structure, range(6)) == {9}


def test_ratio_is_of_the_node_s_own_block():
    parts = [scalars("spring", [[0, -1], [1, -1], [2, -1], [3, -1]], "K", [1e12, 1e5, 1e3, 1e-6])]
    # 1e3/1e12 is below 1e-8, 1e5/1e12 is not; a rotation alone in its block is judged by itself
    assert found(make_structure([[0, 0, 0]], parts)) == {2, 4, 5}
    parts = [scalars("spring", [[i, -1] for i in range(6)], "K", [1.0, 1e-7, 1e-7, 1.0, 1.0, 1.0])]
    assert not found(make_structure([[0, 0, 0]], parts))


def test_scalar_point_without_stiffness():
    nodes = NodeTable(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.array([5, 6]))
    K = sp.csr_array(np.diag([0.0, 2.0]))
    np.testing.assert_array_equal(singular_dofs(K, np.arange(2), nodes), [0])


def test_one_stiff_spring_does_not_make_its_neighbours_soft():
    """Beside 1e19 in a model of 1e10 the 1e10 of the same node stays; what is rounding of 1e19 does not."""
    usual = [scalars("spring", [[6 * p + d, -1] for p in range(4) for d in range(6)], "K", [1e10] * 24)]
    stiff = scalars("spring", [[0, -1]], "K", [1e19])
    assert not found(make_structure(np.arange(12.0).reshape(4, 3), [*usual, stiff]))
    rest = [scalars("spring", [[6 * p + d, -1] for p in range(1, 4) for d in range(6)], "K", [1e10] * 18)]
    lonely = scalars("spring", [[0, -1], [1, -1]], "K", [1e19, 1e4])
    assert found(make_structure(np.arange(12.0).reshape(4, 3), [*rest, lonely])) == {1, 2, 3, 4, 5}


@pytest.mark.parametrize(
    ("stiffness", "mass"),
    [
        # a very stiff spring elsewhere, a large mass beside, and masses that are equal to a negative spring
        ([1e15, 0, 0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1e3, 0, 0, 0, 0, 0]),
        ([1.0, 0, 0, 0, 0, 0, 0, 0, 1e-20, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 0]),
        ([1.0, 0, 0, 0, 0, 0, 0, 0, -1.0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1.0, 0, 1.0, 0, 0, 0]),
    ],
)
def test_neither_stiffness_nor_mass_means_none_of_each(stiffness: list[float], mass: list[float]) -> None:
    nodes = make_structure([[0, 0, 0], [1.0, 0, 0]], []).nodes
    K, M = (sp.csr_array(np.diag(d)) for d in (stiffness, mass))
    held = empty_dofs(K, M, np.arange(12), nodes)
    np.testing.assert_array_equal(held, np.setdiff1d(np.arange(12), [0, 6, 8]))


def test_a_skew_direction_without_stiffness_and_mass_is_found() -> None:
    """A rod and a mass that acts across it, of very different sizes, leave the product of both directions."""
    nodes = make_structure([[0, 0, 0]], []).nodes
    along, across = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
    K, M = np.zeros((2, 6, 6))
    K[:3, :3], M[:3, :3] = 1e11 * np.outer(along, along), 1e-3 * np.outer(across, across)
    np.testing.assert_array_equal(empty_dofs(sp.csr_array(K), sp.csr_array(M), np.arange(6), nodes), [0, 3, 4, 5])
