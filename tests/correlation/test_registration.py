"""Rigid motions of test points onto a mesh: exact ones, points without partner, lines, symmetries, left-handed axes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from femtune.arrays import Reals
from femtune.correlation.guessed_sensors import AskedSensors, guess_sensors
from femtune.correlation.registration import is_symmetry, register
from femtune.fem import NodeTable


def _block(nx: int, ny: int, nz: int) -> Reals:
    axes = [np.arange(n + 1.0) for n in (nx, ny, nz)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


BRACKET = np.concatenate([_block(6, 4, 0), [[0.0, y, z] for y in range(5) for z in (1.0, 2.0, 3.0)], [[6.0, 0.0, 1.0]]])
"""A plate with an upright at one end, and one point at the other: no motion maps it onto itself."""
CHOSEN = np.array([0, 2, 4, 8, 12, 17, 22, 27, 30, 32, 34, 37, 40, 45, 49, 50])
TURN = Rotation.from_euler("xyz", [0.3, -0.8, 1.9]).as_matrix()


def _structure(xyz: Reals) -> Any:
    frames = np.tile(np.eye(3), (len(xyz), 1, 1))
    return SimpleNamespace(nodes=NodeTable(np.arange(1, len(xyz) + 1), xyz, frames))


def _moved(points: Reals, turn: Reals = TURN, shift: tuple[float, float, float] = (40.0, -7.0, 3.0)) -> Reals:
    """Places of the points in axes of which `register` must find the way back."""
    return (points - shift) @ turn


@pytest.mark.slow
@pytest.mark.parametrize("hand", [1.0, -1.0], ids=["right-handed", "left-handed"])
def test_an_exact_motion_is_found_exactly(hand: float) -> None:
    turn = TURN @ np.diag([1.0, 1.0, hand])
    found = register(_moved(BRACKET[CHOSEN], turn), BRACKET)
    assert len(found) == 1
    assert found[0].grids.tolist() == CHOSEN.tolist()
    assert found[0].rotation == pytest.approx(turn, abs=1e-9)
    assert found[0].origin == pytest.approx([40.0, -7.0, 3.0], abs=1e-8)
    assert found[0].is_left_handed == (hand < 0.0)


@pytest.mark.slow
def test_points_without_partner_are_left_out() -> None:
    """Three of sixteen are elsewhere, and the others are off by up to 0.2 of an element."""
    random = np.random.default_rng(5)
    points = BRACKET[CHOSEN] + random.uniform(-0.11, 0.11, (len(CHOSEN), 3))
    points[[1, 7, 11]] += [[0.0, 0.0, -9.0], [5.0, 8.0, 0.0], [0.0, -4.0, 4.0]]
    found = register(_moved(points), BRACKET)
    expected = CHOSEN.copy()
    expected[[1, 7, 11]] = -1
    assert found[0].grids.tolist() == expected.tolist()


@pytest.mark.slow
def test_coordinates_as_they_are_come_first() -> None:
    """A plate has three other motions onto itself; test points in the axes of the model need none."""
    plate = _block(8, 5, 0)
    points = plate[::4] + np.random.default_rng(2).uniform(-0.1, 0.1, (14, 3))
    found = register(points, plate)
    assert len(found) == 1
    assert found[0].is_unchanged


@pytest.mark.slow
def test_symmetries_of_the_mesh_are_among_the_motions() -> None:
    plate = _block(8, 5, 0)
    chosen = np.array([0, 5, 9, 17, 21, 26, 33, 40, 44, 48, 53])
    found = register(_moved(plate[chosen], np.eye(3)), plate)
    assert len(found) == 4
    # the one without a rotation first
    assert found[0].rotation == pytest.approx(np.eye(3))
    assert found[0].grids.tolist() == chosen.tolist()
    assert all(is_symmetry(found[0], other, plate) for other in found[1:])
    guess = guess_sensors(_structure(plate), np.arange(1001, 1012), _moved(plate[chosen], np.eye(3)))
    assert "symmetric" in guess.several


@pytest.mark.slow
def test_numbers_decide_between_symmetries_only() -> None:
    """Equal numbers take the one motion of four that agrees; numbers of other grid points change nothing."""
    plate = _block(8, 5, 0)
    chosen = np.array([0, 5, 9, 17, 21, 26, 33, 40, 44, 48, 53])
    half_turn = np.diag([-1.0, -1.0, 1.0])
    points = _moved(plate[chosen], half_turn)
    agreed = guess_sensors(_structure(plate), chosen + 1, points)
    assert not agreed.several
    assert agreed.test["rotation"] == half_turn.tolist()
    assert "numbers agree" in agreed.words
    wrong = guess_sensors(_structure(plate), np.roll(chosen, 1) + 1, points)
    assert "by_id" not in wrong.sensors
    assert "symmetric" in wrong.several


@pytest.mark.slow
def test_points_on_a_line_of_a_beam() -> None:
    """Both directions along a uniform line; the rotation about it is the smallest."""
    line = np.column_stack([np.arange(13.0), np.zeros(13), np.zeros(13)])
    bent = np.concatenate([line, [[12.0, y, 0.0] for y in (1.0, 2.0, 3.0)]])
    points = _moved(line[::2], Rotation.from_euler("z", 90, degrees=True).as_matrix())
    found = register(points, line)
    assert {tuple(one.grids) for one in found} == {tuple(range(0, 13, 2)), tuple(range(12, -1, -2))}
    assert all(abs(one.rotation[2, 2]) == pytest.approx(1.0) for one in found)
    # the points of an angle are not on one line
    both = _moved(np.concatenate([line[::2], bent[13:]]))
    (only,) = register(both, bent)[:1]
    assert only.grids.tolist() == [*range(0, 13, 2), 13, 14, 15]


@pytest.mark.slow
def test_a_factor_between_units() -> None:
    found = register(1000.0 * _moved(BRACKET[CHOSEN]), BRACKET, factors=(1.0, 25.4, 0.01, 0.001))
    assert found[0].factor == 0.001
    assert found[0].grids.tolist() == CHOSEN.tolist()


@pytest.mark.slow
def test_points_of_another_structure_are_refused() -> None:
    random = np.random.default_rng(3)
    assert register(random.uniform(-4.0, 4.0, (20, 3)), BRACKET) == ()
    guess = guess_sensors(_structure(BRACKET), np.arange(1, 21), random.uniform(50.0, 60.0, (20, 3)))
    assert not guess.found
    assert any("--by-id" in doubt for doubt in guess.doubts)


@pytest.mark.slow
def test_what_the_user_states_of_the_sensors() -> None:
    structure, numbers = _structure(BRACKET), CHOSEN + 1
    shifted = BRACKET[CHOSEN] - [4.0, 0.0, 0.0]
    stated = guess_sensors(structure, numbers, shifted, AskedSensors(origin=(4.0, 0.0, 0.0)))
    assert (stated.test, stated.sensors) == ({"origin": [4.0, 0.0, 0.0]}, {})
    wide = guess_sensors(structure, numbers, BRACKET[CHOSEN] + [0.2, 0.0, 0.0], AskedSensors(tolerance=0.3))
    assert wide.sensors == {"tolerance": 0.3}
    random = np.random.default_rng(3)
    by_id = guess_sensors(structure, numbers, random.uniform(50.0, 60.0, (16, 3)), AskedSensors(by_id=True))
    assert by_id.sensors["by_id"] is True
    assert by_id.sensors["tolerance"] > 40.0
    assert "coordinates of the test points are not those" in by_id.doubts[0]


@pytest.mark.slow
def test_points_without_coordinates_follow_the_numbers_of_the_others() -> None:
    """One point has no place; all others agree with their numbers."""
    points = _moved(BRACKET[CHOSEN])
    points[3] = np.nan
    guess = guess_sensors(_structure(BRACKET), CHOSEN + 1, points)
    assert guess.sensors["nodes"] == {str(CHOSEN[3] + 1): CHOSEN[3] + 1}
    other = guess_sensors(_structure(BRACKET), CHOSEN + 1001, points)
    assert other.sensors["leave_out"] == [CHOSEN[3] + 1001]
