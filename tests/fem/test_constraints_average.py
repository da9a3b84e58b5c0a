"""RBE3 against another least-squares solution, statics and published results."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import scipy.optimize

from femtune.errors import FemtuneError
from femtune.fem.checks import rigid_body_modes
from femtune.fem.constraints import Components, WeightedPoints, average_rows
from femtune.fem.elimination import eliminate
from femtune.fem.structure import NodeTable

EVERY = (1, 2, 3, 4, 5, 6)
XYZ = np.array([[0.4, 0.7, 0.2], [2.0, 0.1, 0.0], [2.2, 3.0, -0.3], [1.0, 1.2, 4.0], [-0.8, 2.0, 1.0]])
GROUPS = (WeightedPoints(1.0, (1, 2, 3), (1, 2)), WeightedPoints(4.7, (1, 3), (3,)), WeightedPoints(2.5, EVERY, (4,)))


def nodes(turned: bool = True, scale: float = 1.0, xyz: np.ndarray = XYZ) -> NodeTable:
    """Grid point 9 is the reference; it stands first."""
    rng = np.random.default_rng(3)
    frames = [np.linalg.qr(rng.standard_normal((3, 3)))[0] if turned else np.eye(3) for _ in xyz]
    numbers = np.array([*range(1, len(xyz)), 9])
    return NodeTable(numbers, scale * np.roll(xyz, -1, axis=0), np.array(frames))


def matrix(table: NodeTable, components: Sequence[int], groups: Sequence[WeightedPoints]) -> np.ndarray:
    """(reference components, g-set): what the reference does for each displacement of the points."""
    rows = average_rows(table, 9, components, groups, 5)
    full = np.zeros((len(rows), table.n_dofs))
    np.add.at(full, (rows.row, rows.dof), -rows.coefficient)
    full[np.arange(len(rows)), rows.dependent] = 0.0
    return full


def best_motion(table: NodeTable, groups: Sequence[WeightedPoints], u: np.ndarray) -> np.ndarray:
    """Displacement and rotation of the reference, basic frame, by a minimiser that knows nothing of our matrices."""
    centre = table.xyz[table.position(9)]
    listed = [n for g in groups for n in g.numbers]
    size = np.mean([np.linalg.norm(table.xyz[table.position(n)] - centre) for n in dict.fromkeys(listed)])

    def misfit(q: np.ndarray) -> np.ndarray:
        out = []
        for g in groups:
            for n in g.numbers:
                at = table.position(n)
                move = table.frames[at].T @ (q[:3] + np.cross(q[3:], table.xyz[at] - centre))
                gap = np.concatenate([move, table.frames[at].T @ q[3:]]) - u[6 * at : 6 * at + 6]
                gap[3:] *= size
                out += [np.sqrt(g.weight) * gap[c - 1] for c in g.components]
        return np.array(out)

    found = scipy.optimize.least_squares(misfit, np.zeros(6), xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    return np.asarray(found.x)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("scale", [1.0, 1e3])
def test_the_reference_moves_with_the_best_fit(turned: bool, scale: float) -> None:
    table = nodes(turned, scale)
    u = np.random.default_rng(4).standard_normal(table.n_dofs)
    u.reshape(-1, 6)[:, 3:] /= scale
    q = best_motion(table, GROUPS, u)
    frame = table.frames[table.position(9)]
    expected = np.concatenate([frame.T @ q[:3], frame.T @ q[3:]])
    np.testing.assert_allclose(matrix(table, EVERY, GROUPS) @ u, expected, rtol=2e-6, atol=1e-7 / scale)


@pytest.mark.parametrize("components", [EVERY, (1, 2, 3), (3, 5)])
def test_rigid_motion_of_the_points_is_that_of_the_reference(components: tuple[int, ...]) -> None:
    table = nodes()
    motions = rigid_body_modes(table)
    own = 6 * table.position(9) + np.array(components) - 1
    np.testing.assert_allclose(matrix(table, components, GROUPS) @ motions, motions[own], atol=1e-13)


def test_rows_do_not_depend_on_what_else_the_reference_follows() -> None:
    """REFC chooses rows of the one fit; it does not hold the other components."""
    table = nodes()
    np.testing.assert_allclose(matrix(table, (1, 2, 3), GROUPS), matrix(table, EVERY, GROUPS)[:3], atol=1e-14)


def test_loads_at_the_reference_are_distributed_with_the_same_resultant() -> None:
    """The transpose spreads a load over the points: force and moment about any point stay."""
    table = nodes()
    load = np.random.default_rng(5).standard_normal(6)
    spread = matrix(table, EVERY, GROUPS).T @ load
    at_reference = np.zeros(table.n_dofs)
    at_reference[6 * table.position(9) : 6 * table.position(9) + 6] = load
    motions = rigid_body_modes(table)
    np.testing.assert_allclose(motions.T @ spread, motions.T @ at_reference, atol=1e-13)


def test_a_force_at_the_weighted_centre_is_shared_by_weight() -> None:
    """Weights 1 and 3 at x = 0 and 4, y = ±1: the centre is x = 3; each point takes its share of the force."""
    xyz = np.array([[3.0, 0, 0], [0, 1, 0], [0, -1, 0], [4, 1, 0], [4, -1, 0.0]])
    table = nodes(False, xyz=xyz)
    groups = (WeightedPoints(1.0, (1, 2, 3), (1, 2)), WeightedPoints(3.0, (1, 2, 3), (3, 4)))
    down = matrix(table, (3,), groups)[0].reshape(-1, 6)
    np.testing.assert_allclose(down[:4, 2], [1 / 8, 1 / 8, 3 / 8, 3 / 8], atol=1e-14)
    assert np.abs(np.delete(down.ravel(), [2, 8, 14, 20])).max() < 1e-14


def test_a_moment_is_shared_as_bolts_share_it() -> None:
    """Turn about the axis of n bolts on a circle: force M/(n r) at each, at right angles to its arm."""
    angle = 2 * np.pi * np.arange(6) / 6
    xyz = np.vstack([[0.0, 0, 5], 2.0 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])])
    table = nodes(False, xyz=xyz)
    turn = matrix(table, (6,), (WeightedPoints(1.0, (1, 2, 3), range(1, 7)),))[0].reshape(-1, 6)[:6]
    expected = np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle]) / (6 * 2.0)
    np.testing.assert_allclose(turn[:, :3], expected, atol=1e-14)


def test_units_of_length_do_not_matter_where_rotations_take_part() -> None:
    metres, millimetres = (matrix(nodes(scale=s), EVERY, GROUPS) for s in (1.0, 1e3))
    unit = np.array([1e3] * 3 + [1.0] * 3)
    changed = unit[:, None] * metres / np.tile(unit, len(XYZ))
    np.testing.assert_allclose(millimetres, changed, rtol=1e-9, atol=1e-12)


def test_displacement_frames_do_not_matter() -> None:
    """The basic motion of the reference for basic motions of the points is the same in all displacement frames."""
    plain, turned = nodes(False), nodes(True)
    whole = (WeightedPoints(1.0, (1, 2, 3), (1, 2)), WeightedPoints(2.5, EVERY, (4,)))
    blocks = np.zeros((turned.n_dofs, turned.n_dofs))
    for i, frame in enumerate(turned.frames):
        blocks[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = np.kron(np.eye(2), frame)
    at = 6 * turned.position(9) + np.arange(6)
    basic = blocks[np.ix_(at, at)] @ matrix(turned, EVERY, whole) @ blocks.T
    np.testing.assert_allclose(basic, matrix(plain, EVERY, whole), atol=1e-13)


UM: list[Components] = [
    [(9, (1, 2, 4)), (1, (3,)), (4, (5, 6))],
    [(9, (1, 2, 3, 4, 5, 6))],
    [(1, (1, 2, 3)), (2, (1, 2)), (3, (3,))],
]


@pytest.mark.parametrize("dependent", UM)
def test_other_dependents_describe_the_same_constraint(dependent: Components) -> None:
    table = nodes()
    rows = average_rows(table, 9, EVERY, GROUPS, 5, dependent)
    found = eliminate(table.n_dofs, rows, [], table.describe).T.toarray()
    # what the new equations allow satisfies the old ones
    plain = matrix(table, EVERY, GROUPS)
    own = 6 * table.position(9) + np.arange(6)
    np.testing.assert_allclose(found[own], plain @ found, atol=1e-12)
    assert found.shape[1] == table.n_dofs - 6
    assert set(rows.dependent.tolist()) == {6 * table.position(n) + c - 1 for n, cs in dependent for c in cs}


LINE = np.array([[0.5, 0.0, 0], [0, 0, 0], [1, 0, 0], [2.0, 0, 0]])


def test_points_on_a_line_determine_all_but_the_turn_about_it() -> None:
    table = nodes(False, xyz=LINE)
    group = (WeightedPoints(1.0, (1, 2, 3), (1, 2, 3)),)
    motions = rigid_body_modes(table)
    own = 6 * table.position(9) + np.array([0, 1, 2, 4, 5])
    np.testing.assert_allclose(matrix(table, (1, 2, 3, 5, 6), group) @ motions, motions[own], atol=1e-13)
    for components, named in (((4,), "4"), (EVERY, "4")):
        with pytest.raises(FemtuneError) as caught:
            average_rows(table, 9, components, group, 5)
        assert caught.value.code == "constraint.undetermined-motion"
        assert f"components {named} of" in caught.value.what
    with_turn = (WeightedPoints(1.0, (1, 2, 3), (1, 2)), WeightedPoints(1.0, (1, 2, 3, 4), (3,)))
    assert len(average_rows(table, 9, EVERY, with_turn, 5)) == 6


def test_a_reference_off_the_line_is_not_determined_at_right_angles() -> None:
    """The turn about the line moves the reference; only its motion in the plane of line and reference is known."""
    table = nodes(False, xyz=LINE + np.array([[0, 1.0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]))
    group = (WeightedPoints(1.0, (1, 2, 3), (1, 2, 3)),)
    assert len(average_rows(table, 9, (1, 2), group, 5)) == 2
    with pytest.raises(FemtuneError, match="components 34 of"):
        average_rows(table, 9, EVERY, group, 5)


def test_a_single_point_at_the_reference_is_followed() -> None:
    table = nodes(False, xyz=np.array([[1.0, 2, 3], [1.0, 2, 3]]))
    full = matrix(table, EVERY, (WeightedPoints(2.0, EVERY, (1,)),))
    np.testing.assert_allclose(full[:, :6], np.eye(6), atol=1e-14)


def test_many_points_cost_little() -> None:
    """Twenty thousand points on a sphere about the reference: each takes its equal share of a force."""
    rng = np.random.default_rng(6)
    xyz = rng.standard_normal((10_000, 3))
    xyz = np.vstack([np.zeros(3), xyz, -xyz])
    table = NodeTable(np.arange(len(xyz)), xyz, np.tile(np.eye(3), (len(xyz), 1, 1)))
    rows = average_rows(table, 0, (1,), (WeightedPoints(3.0, (1, 2, 3), range(1, len(xyz))),), 5)
    np.testing.assert_allclose(rows.coefficient[rows.dof % 6 == 0][1:], -1 / 20_000, rtol=1e-9)


REFUSED = [
    ("constraint.weight", (WeightedPoints(0.0, (1, 2, 3), (1, 2, 3)),), ()),
    ("constraint.weight", (WeightedPoints(-1.0, (1, 2, 3), (1, 2, 3)),), ()),
    ("constraint.own-node", (WeightedPoints(1.0, (1, 2, 3), (1, 9, 3)),), ()),
    ("constraint.twice-in-element", (*GROUPS, WeightedPoints(1.0, (2, 3), (1,))), ()),
    ("model.unknown-node", (WeightedPoints(1.0, (1, 2, 3), (1, 77)),), ()),
    ("constraint.dependent-choice", GROUPS, ((9, (1, 2, 3)),)),
    ("constraint.dependent-choice", GROUPS, ((9, (1, 2, 3, 4, 5)), (3, (2,)))),
    ("constraint.twice-in-element", GROUPS, ((9, (1, 2, 3, 4, 5)), (9, (1,)))),
]


@pytest.mark.parametrize(("code", "groups", "dependent"), REFUSED)
def test_refusals(code: str, groups: Sequence[WeightedPoints], dependent: Components) -> None:
    with pytest.raises(FemtuneError) as caught:
        average_rows(nodes(), 9, EVERY, groups, 5, dependent)
    assert caught.value.code == code
    assert "RBE3 5" in str(caught.value)


def test_dependents_that_cannot_be_solved_for_are_refused() -> None:
    """Motions along x alone: components y of the points do not enter the equation for x."""
    xyz = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 1], [0, -1, 1], [0, 0, -2.0]])
    table = nodes(False, xyz=xyz)
    group = (WeightedPoints(1.0, (1, 2, 3), (1, 2, 3, 4, 5)),)
    with pytest.raises(FemtuneError, match="cannot be solved") as caught:
        average_rows(table, 9, (1,), group, 5, ((1, (2,)),))
    assert caught.value.code == "constraint.dependent-choice"
