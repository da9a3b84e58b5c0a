"""Equations of rigid elements against rigid motion and hand results."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.checks import rigid_body_modes
from femtune.fem.constraints import rigid_bar_rows, rigid_element_rows
from femtune.fem.elimination import eliminate
from femtune.fem.structure import ConstraintRows, NodeTable, join_constraints

XYZ = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [1.0, 1.0, 4.0]])


def nodes(turned: bool) -> NodeTable:
    rng = np.random.default_rng(2)
    frames = [np.linalg.qr(rng.standard_normal((3, 3)))[0] if turned else np.eye(3) for _ in XYZ]
    return NodeTable(np.array([10, 20, 30, 40]), XYZ, np.array(frames))


def residual(rows: ConstraintRows, u: np.ndarray) -> np.ndarray:
    out = np.zeros((len(rows), u.shape[1]))
    np.add.at(out, rows.row, rows.coefficient[:, None] * u[rows.dof])
    return out


@pytest.mark.parametrize("turned", [False, True])
def test_rbe2_admits_rigid_motion_only(turned: bool):
    table = nodes(turned)
    rows = rigid_element_rows(table, 10, [20, 40], [1, 2, 3, 4, 5, 6], 7)
    assert np.abs(residual(rows, rigid_body_modes(table))).max() < 1e-14
    assert set(rows.owner) == {7}
    assert set(rows.dependent) == {*range(6, 12), *range(18, 24)}


def test_rbe2_by_hand():
    """Node 30 at (2, 3, 0) from node 10: u_x = u − 3 θ_z, u_y = v + 2 θ_z."""
    table = nodes(False)
    rows = rigid_element_rows(table, 10, [30], [1, 2, 6], 7)
    T = eliminate(table.n_dofs, rows, [], table.describe).T.toarray()
    np.testing.assert_allclose(T[12, :6], [1, 0, 0, 0, 0, -3], atol=1e-15)
    np.testing.assert_allclose(T[13, :6], [0, 1, 0, 0, 0, 2], atol=1e-15)
    np.testing.assert_allclose(T[17, :6], [0, 0, 0, 0, 0, 1], atol=1e-15)


def test_components_are_those_of_the_dependent_frame():
    """A dependent point whose x axis is the basic y axis follows in y."""
    frames = np.tile(np.eye(3), (2, 1, 1))
    frames[1] = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    table = NodeTable(np.array([1, 2]), np.array([[0.0, 0, 0], [0.0, 0, 5.0]]), frames)
    T = eliminate(12, rigid_element_rows(table, 1, [2], [1], 3), [], table.describe).T.toarray()
    # y displacement at height 5: v − 5 θ_x
    np.testing.assert_allclose(T[6, :6], [0, 1, 0, -5, 0, 0], atol=1e-15)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("independent", "dependent"),
    [
        (((1, 2, 3, 4, 5, 6), ()), ((), ())),
        (((), (1, 2, 3, 4, 5, 6)), ((1, 2, 3), ())),
        (((1, 2, 3, 4), (2, 3)), ((5, 6), (1, 4, 5, 6))),
    ],
)
def test_rbar_admits_rigid_motion(independent: tuple, dependent: tuple, turned: bool):
    table = nodes(turned and len(independent[0]) in (0, 6))
    rows = rigid_bar_rows(table, (10, 20), independent, dependent, 9)
    expected = sum(map(len, dependent)) or 6
    assert len(rows) == expected
    assert np.abs(residual(rows, rigid_body_modes(table))).max() < 1e-13


BAD = [
    ("constraint.rigid-independent", ((1, 2, 3, 4, 5), ()), ((), ())),
    ("constraint.rigid-independent", ((1, 2, 3), (1, 2, 3)), ((), ())),
    ("constraint.rigid-independent", ((1, 2, 3, 5, 6), (1,)), ((), ())),
    ("constraint.twice-in-element", ((1, 2, 3, 4, 5, 6), ()), ((6,), (1,))),
]


@pytest.mark.parametrize(("code", "independent", "dependent"), BAD)
def test_rbar_refusals(code: str, independent: tuple, dependent: tuple):
    with pytest.raises(FemtuneError) as caught:
        rigid_bar_rows(nodes(False), (10, 20), independent, dependent, 9)
    assert caught.value.code == code
    assert "RBAR 9" in str(caught.value)


def test_own_node_is_refused():
    for make in (
        lambda: rigid_element_rows(nodes(False), 10, [20, 10], [1], 5),
        lambda: rigid_bar_rows(nodes(False), (10, 10), ((1, 2, 3, 4, 5, 6), ()), ((), ()), 5),
    ):
        with pytest.raises(FemtuneError) as caught:
            make()
        assert caught.value.code == "constraint.own-node"


def test_chain_of_rigid_elements_is_one_rigid_body():
    """10 carries 20, 20 carries 30, 30 carries 40, in any order of the equations."""
    table = nodes(True)
    every = [1, 2, 3, 4, 5, 6]
    links = [rigid_element_rows(table, a, [b], every, b) for a, b in ((30, 40), (10, 20), (20, 30))]
    found = eliminate(table.n_dofs, join_constraints(links), [], table.describe)
    direct = eliminate(table.n_dofs, rigid_element_rows(table, 10, [20, 30, 40], every, 1), [], table.describe)
    np.testing.assert_allclose(found.T.toarray(), direct.T.toarray(), atol=1e-14)
    assert list(found.free) == list(range(6))
