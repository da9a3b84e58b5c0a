"""RBE1, RTRPLT and RROD against rigid motion, the RBE2 and hand results."""

from __future__ import annotations

import numpy as np
import pytest

from femtune.errors import FemtuneError
from femtune.fem.checks import rigid_body_modes
from femtune.fem.constraints import Components, rigid_body_rows, rigid_element_rows, rigid_plate_rows, rigid_rod_rows
from femtune.fem.elimination import eliminate
from femtune.fem.structure import ConstraintRows, NodeTable

XYZ = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [1.0, 1.0, 4.0]])
EVERY = (1, 2, 3, 4, 5, 6)


def nodes(turned: bool, scale: float = 1.0) -> NodeTable:
    rng = np.random.default_rng(2)
    frames = [np.linalg.qr(rng.standard_normal((3, 3)))[0] if turned else np.eye(3) for _ in XYZ]
    return NodeTable(np.array([10, 20, 30, 40]), scale * XYZ, np.array(frames))


def residual(rows: ConstraintRows, u: np.ndarray) -> np.ndarray:
    out = np.zeros((len(rows), u.shape[1]))
    np.add.at(out, rows.row, rows.coefficient[:, None] * u[rows.dof])
    return out


# six components at three points that fix a body, however the points' frames are turned
SPREAD: list[Components] = [
    [(10, EVERY)],
    [(10, (1, 2, 3)), (20, (2, 3)), (30, (3,))],
    [(10, (1, 2, 3)), (20, (4, 5, 6))],
]


@pytest.mark.parametrize("independent", SPREAD)
@pytest.mark.parametrize("scale", [1.0, 1e3, 1e9])
def test_rbe1_is_one_rigid_body(independent: Components, scale: float) -> None:
    table = nodes(turned=len(independent) != 3, scale=scale)
    rows = rigid_body_rows(table, independent, [(40, EVERY), (30, (1, 2))], 7)
    assert len(rows) == 8
    assert np.abs(residual(rows, rigid_body_modes(table))).max() < 1e-11 * scale


def test_rbe1_with_one_independent_point_is_an_rbe2() -> None:
    table = nodes(True)
    one = rigid_body_rows(table, [(10, EVERY)], [(20, (1, 3)), (40, (1, 3))], 7)
    two = rigid_element_rows(table, 10, [20, 40], [1, 3], 7)
    T, U = (eliminate(table.n_dofs, rows, [], table.describe).T.toarray() for rows in (one, two))
    np.testing.assert_allclose(T, U, atol=1e-14)


def test_rbe1_from_three_points_by_hand() -> None:
    """Heights of three points make a plane: (0,0), (2,0), (2,3) give w at (1, 1) as a mean of them."""
    table = nodes(False)
    rows = rigid_body_rows(table, [(10, (1, 2, 3)), (20, (2, 3)), (30, (3,))], [(40, (3,))], 7)
    T = eliminate(table.n_dofs, rows, [], table.describe).T.toarray()
    free = eliminate(table.n_dofs, rows, [], table.describe).free
    heights = [list(free).index(6 * i + 2) for i in range(3)]
    np.testing.assert_allclose(T[20, heights], [1 / 2, 1 / 6, 1 / 3], atol=1e-14)


def test_rtrplt_takes_what_is_left() -> None:
    table = nodes(False)
    free = [(10, (1, 2, 3)), (20, (2, 3)), (30, (3,))]
    rows = rigid_plate_rows(table, [10, 20, 30], free, [], 7, "RTRPLT")
    assert len(rows) == 12
    assert np.abs(residual(rows, rigid_body_modes(table))).max() < 1e-13


BAD = {
    "constraint.rigid-independent": [
        ([(10, (1, 2, 3))], [(40, EVERY)]),
        # translations of two points leave the turn about their line open
        ([(10, (1, 2, 3)), (20, (1, 2, 3))], [(40, EVERY)]),
        ([], [(40, EVERY)]),
    ],
    "constraint.twice-in-element": [
        ([(10, EVERY)], [(40, (1, 2)), (40, (2, 3))]),
        ([(10, EVERY)], [(10, (1,)), (40, (2, 3))]),
        ([(10, (1, 2, 3)), (20, (2, 3)), (20, (3,))], [(40, (2,))]),
    ],
    "model.unknown-node": [([(10, EVERY)], [(41, EVERY)])],
}


@pytest.mark.parametrize(("code", "lists"), [(code, lists) for code, several in BAD.items() for lists in several])
def test_rbe1_refusals(code: str, lists: tuple[Components, Components]) -> None:
    with pytest.raises(FemtuneError) as caught:
        rigid_body_rows(nodes(False), *lists, 9)
    assert caught.value.code == code
    assert "RBE1 9" in str(caught.value)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("dependent", [(0, 1), (1, 1)])
def test_rrod_keeps_the_distance_and_nothing_else(turned: bool, dependent: tuple[int, int]) -> None:
    table = nodes(turned)
    rows = rigid_rod_rows(table, (10, 40), dependent, 5)
    assert len(rows) == 1
    assert np.abs(residual(rows, rigid_body_modes(table))).max() < 1e-14
    # displacements of the ends that leave their distance: at right angles to the rod, in the basic frame
    u = np.zeros((table.n_dofs, 1))
    u[18:21, 0] = table.frames[3].T @ np.cross(XYZ[3], [0.3, -0.2, 0.9])
    assert np.abs(residual(rows, u)).max() < 1e-14
    u[0:3, 0] = table.frames[0].T @ (0.1 * XYZ[3])
    assert np.abs(residual(rows, u)).max() > 1e-2


def test_rrod_by_hand() -> None:
    """From (0, 0, 0) to (2, 3, 0): 2 (u_b − u_a) + 3 (v_b − v_a) = 0."""
    table = nodes(False)
    T = eliminate(table.n_dofs, rigid_rod_rows(table, (10, 30), (1, 2), 5), [], table.describe)
    row = dict(zip(T.free.tolist(), T.T.toarray()[13]))
    assert [row[0], row[1], row[12]] == pytest.approx([2 / 3, 1.0, -2 / 3])


@pytest.mark.parametrize(
    ("code", "ends", "dependent"),
    [
        ("constraint.rod-component", (10, 20), (0, 3)),
        ("element.zero-length", (10, 10), (0, 1)),
        ("model.unknown-node", (10, 11), (0, 1)),
    ],
)
def test_rrod_refusals(code: str, ends: tuple[int, int], dependent: tuple[int, int]) -> None:
    with pytest.raises(FemtuneError) as caught:
        rigid_rod_rows(nodes(False), ends, dependent, 5)
    assert caught.value.code == code
    assert "RROD 5" in str(caught.value)
