"""Sensors on the model: hand results in rotated frames, nearest nodes, combinations, what goes wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from femtune.correlation import GeneralisedSensor, map_sensors, rigid_motion_sensor, sensor_map
from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, FemtuneErrors
from femtune.fem.structure import NodeTable, Structure
from femtune.fem.values import ValueTable
from femtune.modal import ModeSet
from femtune.testdata import ModalTest, Sensor
from femtune.units import SI

X, Y, Z = np.eye(3)


def _structure(
    points: Sequence[Sequence[float]], ids: Sequence[int] | None = None, frames: np.ndarray | None = None
) -> Structure:
    numbers = np.array(ids if ids is not None else range(1, len(points) + 1), dtype=np.int64)
    xyz = np.array(points, float).reshape(-1, 3)
    frames = np.tile(np.eye(3), (len(points), 1, 1)) if frames is None else frames
    return Structure(NodeTable(numbers, xyz, frames, np.array([900])), ValueTable((), np.zeros(0)), ())


def _sensor(label: str, position: Sequence[float], direction: Sequence[float]) -> Sensor:
    return Sensor(parse_dof(label), np.array(position, float), np.array(direction, float))


def _test(*sensors: Sensor, modes: ModeSet | None = None) -> ModalTest:
    return ModalTest("bench", SI, sensors=sensors, modes=modes)


def _shapes(*labels: str) -> ModeSet:
    return ModeSet(np.array([1.0]), np.ones((len(labels), 1)), DofSet.parse(labels))


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_nearest_nodes_and_distances() -> None:
    test = _test(_sensor("10Z+", (0.01, 0, 0), Z), _sensor("11X-", (1, 0.98, 0), -X))
    found = map_sensors(test, _structure(SQUARE), tolerance=0.05)
    assert [(str(m.label), m.node, m.how) for m in found.matches] == [("10Z+", 1, "nearest"), ("11X-", 3, "nearest")]
    assert [m.distance for m in found.matches] == pytest.approx([0.01, 0.02])
    expected = np.zeros((2, 25))
    expected[0, 2] = 1.0
    expected[1, 12] = -1.0
    assert found.matrix.toarray() == pytest.approx(expected)
    assert found.dofs.labels() == ["10Z+", "11X-"]
    assert not found.notices


def test_a_rotated_displacement_frame_by_hand() -> None:
    # node 1's axes: x' = Y, y' = −X, z' = Z (columns of the frame)
    frames = np.tile(np.eye(3), (4, 1, 1))
    frames[0] = np.column_stack([Y, -X, Z])
    skew = np.array([0.6, 0.8, 0.0])
    test = _test(_sensor("1X+", (0, 0, 0), X), _sensor("1Y+", (0, 0, 0), skew), _sensor("1RX+", (0, 0, 0), X))
    found = map_sensors(test, _structure(SQUARE, frames=frames), tolerance=0.1).matrix.toarray()
    assert found[0, :6] == pytest.approx([0, -1, 0, 0, 0, 0])
    assert found[1, :6] == pytest.approx([0.8, -0.6, 0, 0, 0, 0])
    assert found[2, :6] == pytest.approx([0, 0, 0, 0, -1, 0])
    assert not found[:, 6:].any()


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_any_frame_gives_the_motion_in_the_sensor_direction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = Rotation.random(4, random_state=seed).as_matrix()
    d = rng.normal(size=3)
    d /= np.linalg.norm(d)
    u_basic = rng.normal(size=3)
    u = np.zeros(25)
    u[6:9] = np.linalg.solve(frames[1], u_basic)
    found = map_sensors(_test(_sensor("7X+", SQUARE[1], d)), _structure(SQUARE, frames=frames), tolerance=0.1)
    assert found.matrix @ u == pytest.approx([d @ u_basic])


def test_equal_distances_take_the_lower_number_and_say_so() -> None:
    structure = _structure([[0, 0, 0], [0, 0, 0], [1, 0, 0]], ids=[12, 40, 50])
    test = _test(_sensor("1X+", (0.001, 0, 0), X), _sensor("1Y+", (0.001, 0, 0), Y))
    found = map_sensors(test, structure, tolerance=0.01)
    assert [m.node for m in found.matches] == [12, 12]
    assert [n.code for n in found.notices] == ["sensor.tie"]
    assert "grid points 12 and 40; grid point 12 is used" in found.notices[0].what
    chosen = map_sensors(test, structure, tolerance=0.01, given={1: 40})
    assert [(m.node, m.how) for m in chosen.matches] == [(40, "given"), (40, "given")]
    assert not chosen.notices


def test_by_number_and_far_away() -> None:
    """Places that contradict the numbers are an error; by hand they are told."""
    test = _test(_sensor("3Z+", (0, 0, 0), Z))
    with pytest.raises(FemtuneError) as far:
        map_sensors(test, _structure(SQUARE), tolerance=0.1, by_id=True)
    assert far.value.code == "sensor.too-far"
    assert far.value.values == {"3Z+": "1.414 from grid point 3"}
    found = map_sensors(test, _structure(SQUARE), tolerance=1.5, by_id=True)
    assert (found.matches[0].node, found.matches[0].how) == (3, "by id")
    assert found.matches[0].distance == pytest.approx(np.sqrt(2))
    by_hand = map_sensors(test, _structure(SQUARE), tolerance=0.1, given={3: 3})
    assert by_hand.notices[0].code == "sensor.far-from-node"
    with pytest.raises(FemtuneError, match=r"sensor\.unmatched") as caught:
        map_sensors(_test(_sensor("77Z+", (0, 0, 0), Z)), _structure(SQUARE), tolerance=0.1, by_id=True)
    assert "have no grid point with their number" in str(caught.value)


def test_a_test_without_geometry_by_number_only() -> None:
    test = _test(modes=_shapes("3Z-", "2RY+"))
    found = map_sensors(test, _structure(SQUARE), tolerance=0.1, by_id=True)
    expected = np.zeros((2, 25))
    expected[0, 14] = -1
    expected[1, 10] = 1
    assert found.matrix.toarray() == pytest.approx(expected)
    with pytest.raises(FemtuneError) as caught:
        map_sensors(test, _structure(SQUARE), tolerance=0.1)
    assert caught.value.code == "sensor.no-position"
    assert caught.value.what.endswith(" 3Z-, 2RY+")
    assert "by_id = true" in caught.value.hint


def test_one_place_for_all_points_is_no_place() -> None:
    """Export programs write zeros: by number no distance is stated, and by distance nothing is assigned."""
    test = _test(*(_sensor(f"{i}Z+", (0, 0, 0), Z) for i in (1, 2, 3, 4)))
    found = map_sensors(test, _structure(SQUARE), tolerance=0.1, by_id=True)
    assert [m.node for m in found.matches] == [1, 2, 3, 4]
    assert np.isnan([m.distance for m in found.matches]).all()
    assert [(n.code, n.level) for n in found.notices] == [("sensor.no-distance", "info")]
    with pytest.raises(FemtuneError, match=r"\(0, 0, 0\) for all its points") as caught:
        map_sensors(test, _structure(SQUARE), tolerance=0.1)
    assert "by_id = true" in caught.value.hint


def test_all_sensors_on_one_grid_point_is_an_error() -> None:
    test = _test(*(_sensor(f"{i}Z+", (1e-3 * x, 1e-3 * y, 0), Z) for i, (x, y, _) in enumerate(SQUARE[:4], 1)))
    with pytest.raises(FemtuneError) as caught:
        map_sensors(test, _structure(SQUARE), tolerance=0.1)
    assert caught.value.code == "sensor.one-grid"
    assert "millimetres" in caught.value.hint
    # two sensors at one grid point are told, not refused
    near = _test(_sensor("1Z+", (0, 0, 0), Z), _sensor("2Z+", (0.01, 0, 0), Z))
    assert [n.code for n in map_sensors(near, _structure(SQUARE), tolerance=0.1).notices] == ["sensor.shared-node"]


def test_notices_of_one_kind_are_one() -> None:
    test = _test(*(_sensor(f"{i}Z+", (0.1 * i, 0.2, 3.0), Z) for i in (1, 2, 3, 4)))
    (far,) = map_sensors(test, _structure(SQUARE), tolerance=0.1, given={i: i for i in (1, 2, 3, 4)}).notices
    assert far.code == "sensor.far-from-node"
    assert far.what.endswith("; 3 more test nodes are farther than the tolerance")


def test_scalar_points() -> None:
    found = map_sensors(_test(modes=_shapes("900S-")), _structure(SQUARE), tolerance=0.1, by_id=True)
    assert found.matrix.toarray()[0, 24] == -1.0
    assert map_sensors(
        _test(modes=_shapes("5S+")), _structure(SQUARE), tolerance=0.1, given={5: 900}
    ).matrix.indices.tolist() == [24]


def test_two_test_nodes_on_one_grid_point() -> None:
    test = _test(_sensor("1Z+", (0, 0, 0), Z), _sensor("2Z+", (0.01, 0, 0), Z))
    notices = map_sensors(test, _structure(SQUARE), tolerance=0.1).notices
    assert [n.code for n in notices] == ["sensor.shared-node"]
    assert "test nodes 1, 2 " in notices[0].what


def test_unmatched_sensors_are_all_listed() -> None:
    test = _test(_sensor("1Z+", (0, 0, 0), Z), _sensor("2Z+", (1, 0, 0.3), Z), _sensor("3Z+", (5, 1, 0), Z))
    with pytest.raises(FemtuneError) as caught:
        map_sensors(test, _structure(SQUARE), tolerance=0.1)
    assert caught.value.code == "sensor.unmatched"
    assert list(caught.value.values) == ["2Z+", "3Z+"]
    found = map_sensors(test, _structure(SQUARE), tolerance=0.1, leave_unmatched=True)
    assert found.dofs.labels() == ["1Z+"]
    assert [(str(u.label), u.nearest, u.distance) for u in found.unmatched] == [
        ("2Z+", 2, pytest.approx(0.3)),
        ("3Z+", 3, pytest.approx(4.0)),
    ]
    assert found.notices[0].code == "sensor.left-out"


BOX = [[1.0, 0.5, 0.2], [2.0, 0.5, 0.2], [2.0, 1.5, 0.2], [1.0, 1.5, 0.9], [1.4, 0.8, 0.55]]


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1000.0, "millimetres where the model has metres"),
        (0.001, "metres where the model has millimetres"),
        (1 / 0.0254, "inches where the model has metres"),
        (1 / 25.4, "inches where the model has millimetres"),
        (100.0, "centimetres where the model has metres"),
    ],
)
def test_units_are_guessed_in_the_hint(factor: float, words: str) -> None:
    sensors = [_sensor(f"{i + 1}Z+", factor * np.array(p) + 1e-9, Z) for i, p in enumerate(BOX)]
    with pytest.raises(FemtuneError) as caught:
        map_sensors(_test(*sensors), _structure(BOX), tolerance=1e-4)
    assert words in caught.value.hint


def test_axes_are_guessed_in_the_hint() -> None:
    turned = [(-z, x, y) for x, y, z in BOX]
    sensors = [_sensor(f"{i + 1}Z+", p, Z) for i, p in enumerate(turned)]
    with pytest.raises(FemtuneError) as caught:
        map_sensors(_test(*sensors), _structure(BOX), tolerance=1e-4)
    assert caught.value.hint.endswith(" Y, Z, -X")


def test_no_guess_where_nothing_fits() -> None:
    sensors = [_sensor(f"{i + 1}Z+", np.array(p) + 7.3, Z) for i, p in enumerate(BOX)]
    with pytest.raises(FemtuneError) as caught:
        map_sensors(_test(*sensors), _structure(BOX), tolerance=1e-4)
    assert caught.value.hint.startswith("check ")


def test_points_that_shrink_onto_one_node_are_no_guess() -> None:
    sensors = [_sensor(f"{i + 1}Z+", p, Z) for i, p in enumerate([(500, 0, 0), (0, 500, 0), (0, 0, 500)])]
    with pytest.raises(FemtuneError) as caught:
        map_sensors(_test(*sensors), _structure([[0, 0, 0], [9, 9, 9]]), tolerance=1.0)
    assert "look like" not in caught.value.hint


def test_a_combination_replaces_a_sensor_sign_included() -> None:
    test = _test(modes=_shapes("5X-", "5RZ+"))
    mean = GeneralisedSensor(Dof(5, "X"), ((1, 1, 0.5), (2, 1, 0.25), (1, 1, 0.25)))
    twist = GeneralisedSensor(Dof(5, "RZ", -1), ((2, 2, 1.0), (1, 2, -1.0)))
    found = map_sensors(test, _structure(SQUARE), tolerance=0.1, combinations=(mean, twist))
    expected = np.zeros((2, 25))
    expected[0, [0, 6]] = -0.75, -0.25
    expected[1, [7, 1]] = -1.0, 1.0
    assert found.matrix.toarray() == pytest.approx(expected)
    assert [m.how for m in found.matches] == ["combination", "combination"]


@pytest.mark.slow
@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_floor_motion_from_four_corners_is_exact_for_rigid_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.array(SQUARE, float) * [6.0, 4.0, 1.0] + [0, 0, 3.0]
    frames = Rotation.random(4, random_state=seed).as_matrix()
    structure = _structure(points.tolist(), frames=frames)
    origin = np.array([2.0, 1.0, 3.5])
    sensors = rigid_motion_sensor(structure, 70, [1, 2, 3, 4], origin, "126453")
    shift, turn = rng.normal(size=(2, 3))
    u = np.zeros(25)
    for i, p in enumerate(points):
        u[6 * i : 6 * i + 3] = frames[i].T @ (shift + np.cross(turn, p - origin))
    found = map_sensors(
        _test(modes=_shapes("70X+", "70Y+", "70Z+", "70RX+", "70RY+", "70RZ+")),
        structure,
        tolerance=0.1,
        combinations=sensors,
    )
    assert found.matrix @ u == pytest.approx(np.concatenate([shift, turn]))


def test_floor_motion_by_hand() -> None:
    # two nodes two apart on the x axis: X is their mean, RZ the difference of Y over the distance
    structure = _structure([[-1, 0, 0], [1, 0, 0]])
    terms = {
        str(s.dof): {(n, c): v for n, c, v in s.terms} for s in rigid_motion_sensor(structure, 9, [1, 2], (0, 0, 0))
    }
    assert terms["9X+"] == pytest.approx({(1, 1): 0.5, (2, 1): 0.5})
    assert terms["9Y+"] == pytest.approx({(1, 2): 0.5, (2, 2): 0.5})
    assert terms["9RZ+"] == pytest.approx({(1, 2): -0.5, (2, 2): 0.5})


def test_nodes_that_do_not_determine_the_motion() -> None:
    structure = _structure([[-1, 0, 0], [1, 0, 0], [3, 0, 0]])
    with pytest.raises(FemtuneError, match=r"components RX .*test node 9"):
        rigid_motion_sensor(structure, 9, [1, 2, 3], (0, 0, 0), "123456")
    with pytest.raises(FemtuneError, match=r"sensor\.rigid-motion"):
        rigid_motion_sensor(structure, 9, [2], (0, 0, 0))
    with pytest.raises(FemtuneError, match=r"sensor\.rigid-motion"):
        rigid_motion_sensor(structure, 9, [], (0, 0, 0))
    with pytest.raises(FemtuneError, match="has a node twice"):
        rigid_motion_sensor(structure, 9, [1, 1], (0, 0, 0))
    with pytest.raises(FemtuneError, match=r"model\.unknown-node"):
        rigid_motion_sensor(structure, 9, [1, 99], (0, 0, 0))
    for components in ("127", "", "11"):
        with pytest.raises(FemtuneError, match=r"sensor\.components"):
            rigid_motion_sensor(structure, 9, [1, 2], (0, 0, 0), components)


def test_set_up_errors_are_shown_together() -> None:
    with pytest.raises(FemtuneErrors) as caught:
        map_sensors(
            _test(_sensor("1Z+", (0, 0, 0), Z)),
            _structure(SQUARE),
            tolerance=0.0,
            given={8: 1},
            combinations=(GeneralisedSensor(Dof(9, "X"), ((1, 1, 1.0),)),),
        )
    codes = [e.code for e in caught.value.errors]
    assert codes == ["sensor.tolerance", "sensor.given-unknown", "sensor.combination-unused"]


def test_unknown_nodes_and_far_sensors_together() -> None:
    test = _test(_sensor("1Z+", (0, 0, 0), Z), _sensor("2Z+", (9, 9, 9), Z))
    with pytest.raises(FemtuneErrors) as caught:
        map_sensors(test, _structure(SQUARE), tolerance=0.1, given={1: 55})
    assert [e.code for e in caught.value.errors] == ["model.unknown-node", "sensor.unmatched"]


def test_a_model_without_grid_points() -> None:
    with pytest.raises(FemtuneError, match="the model has no grid points"):
        map_sensors(_test(_sensor("1Z+", (0, 0, 0), Z)), _structure([], frames=np.zeros((0, 3, 3))), tolerance=0.1)


def test_a_test_without_sensors_is_empty() -> None:
    assert map_sensors(_test(), _structure(SQUARE), tolerance=0.1).matrix.shape == (0, 25)


_METRES = {"millimetres": 1e-3, "centimetres": 1e-2, "metres": 1.0, "inches": 0.0254, "feet": 0.3048}


def test_factors_between_units_of_length() -> None:
    """A coordinate in the unit of the test times the factor is one in the unit of the model."""
    named = {
        factor: words.split(" where the model has ") for factor, words in sensor_map.LENGTH_FACTORS.items() if words
    }
    assert len(named) == 18
    for factor, (test, model) in named.items():
        assert factor == pytest.approx(_METRES[test] / _METRES[model], rel=1e-12)


def test_scalar_points_have_no_place_and_are_found_by_their_numbers() -> None:
    found = map_sensors(_test(_sensor("1Z+", (0, 0, 0), Z), modes=_shapes("900S+")), _structure(SQUARE), tolerance=0.1)
    assert found.matches[1].node == 900
    with pytest.raises(FemtuneError, match=r"901S.*no scalar points with these numbers"):
        map_sensors(_test(modes=_shapes("901S+")), _structure(SQUARE), tolerance=0.1)
