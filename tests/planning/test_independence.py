"""Effective independence: a closed form, the definition without updates, exhaustive search, random sets."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from femtune.arrays import Reals
from femtune.errors import FemtuneError
from femtune.planning import (
    Candidates,
    Placed,
    eliminate,
    expand,
    information_of,
    log_det,
    outcome_of,
    set_independence,
    unlike,
)


def _beam(points: int, modes: int) -> Reals:
    """(points, 1, modes) modes of a simply supported beam at equally spaced points: sin(jπi/(n + 1))."""
    i, j = np.arange(1, points + 1), np.arange(1, modes + 1)
    return np.sin(np.pi * np.outer(i, j) / (points + 1))[:, None, :]


def _random(sites: int, directions: int, modes: int, seed: int = 0) -> Reals:
    return np.random.default_rng(seed).standard_normal((sites, directions, modes))


def test_the_shares_of_a_simply_supported_beam() -> None:
    points, modes = 23, 5
    shapes = _beam(points, modes)
    # the sines are orthogonal over the points: ΦᵀΦ = (n + 1)/2, so E_i = 2/(n + 1) Σ_j sin²(jπi/(n + 1))
    i = np.arange(1, points + 1) * np.pi / (points + 1)
    # Σ_{j ≤ m} sin²(jx) = m/2 − sin(mx)cos((m + 1)x)/(2 sin x)
    exact = (modes - np.sin(modes * i) * np.cos((modes + 1) * i) / np.sin(i)) / (points + 1)
    found = set_independence(shapes, information_of(shapes))
    np.testing.assert_allclose(found, exact, atol=1e-13)
    assert np.isclose(found.sum(), modes)


def _removed_by_definition(shapes: Reals, count: int) -> list[int]:
    """Every share from the matrix 1 − ΦQ⁻¹Φᵀ of all candidates, anew after each removal."""
    left = list(range(len(shapes)))
    while len(left) > count:
        rows = shapes[left].reshape(-1, shapes.shape[2])
        E = rows @ np.linalg.inv(rows.T @ rows) @ rows.T
        d = shapes.shape[1]
        lost = [np.linalg.det(np.eye(d) - E[d * k : d * k + d, d * k : d * k + d]) for k in range(len(left))]
        left.pop(int(np.argmax(lost)))
    return left


@pytest.mark.quick(1)
@pytest.mark.parametrize("directions", [1, 3])
def test_elimination_removes_what_the_definition_removes(directions: int) -> None:
    # more removals than are updated in one go
    shapes = _random(150, directions, 6)
    found = eliminate(Candidates(shapes), 9)
    assert sorted(found.chosen) == _removed_by_definition(shapes, 9)


def test_the_share_of_a_triaxial_sensor_is_what_is_lost_of_the_determinant() -> None:
    shapes = _random(12, 3, 7)
    Q = information_of(shapes)
    found = set_independence(shapes, Q)
    exact = [1.0 - np.linalg.det(Q - information_of(one)) / np.linalg.det(Q) for one in shapes]
    np.testing.assert_allclose(found, exact, rtol=1e-10)


@pytest.mark.parametrize("directions", [1, 3])
@pytest.mark.parametrize("seed", range(5))
def test_an_expanded_and_exchanged_set_beside_the_best_of_all_sets(directions: int, seed: int) -> None:
    shapes, count = _random(13, directions, 4, seed), 5
    best = max(log_det(information_of(shapes[list(some)])) for some in combinations(range(13), count))
    found = expand(Candidates(shapes), count)
    plain = expand(Candidates(shapes), count, exchange=False)
    reached = log_det(information_of(shapes[found.chosen]))
    assert reached <= best + 1e-9
    # a set that no single exchange improves
    assert reached > best - 0.15
    assert reached >= log_det(information_of(shapes[plain.chosen])) - 1e-9


def test_no_single_exchange_improves_the_set() -> None:
    shapes, count = _random(40, 1, 6, 3), 9
    chosen = expand(Candidates(shapes), count).chosen.tolist()
    reached = log_det(information_of(shapes[chosen]))
    for k in range(count):
        for other in set(range(40)) - set(chosen):
            changed = [*chosen[:k], other, *chosen[k + 1 :]]
            assert log_det(information_of(shapes[changed])) <= reached + 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("method", ["expansion", "elimination"])
def test_placed_sensors_beside_random_ones(method: str) -> None:
    shapes, count, rng = _beam(60, 6), 9, np.random.default_rng(1)
    chosen = (expand if method == "expansion" else eliminate)(Candidates(shapes), count).chosen
    own = outcome_of(shapes[chosen].reshape(count, -1))
    others = [outcome_of(shapes[rng.choice(60, count, replace=False)].reshape(count, -1)) for _ in range(1000)]
    assert own.log_det > max(o.log_det for o in others)
    assert own.root_mean_square < np.quantile([o.root_mean_square for o in others], 0.05)


def test_each_step_of_an_expansion_is_the_best_one() -> None:
    shapes, count = _random(30, 3, 5, 2), 6
    chosen = expand(Candidates(shapes), count, exchange=False).chosen.tolist()
    for k in range(2, count):
        # from two triaxial sensors on the information is regular
        gains = [log_det(information_of(shapes[[*chosen[:k], i]])) for i in range(30) if i not in chosen[:k]]
        assert np.isclose(max(gains), log_det(information_of(shapes[chosen[: k + 1]])), rtol=1e-9)


def test_sensors_that_are_there_count_as_information() -> None:
    shapes = np.eye(4)[:, None, :]
    there = Placed(shapes[:2], shapes[:2])
    assert set(expand(Candidates(shapes), 2, (there,)).chosen) == {2, 3}


def test_a_candidate_that_repeats_a_placed_sensor_is_left_out() -> None:
    shapes = _random(20, 1, 4)
    shapes[10:] = 3.0 * shapes[:10] + 0.01 * _random(10, 1, 4, 1)
    found = expand(Candidates(shapes), 6, threshold=0.01)
    assert len(set(found.chosen % 10)) == 6
    assert found.rejected >= 6
    for a, b in combinations(found.chosen, 2):
        assert unlike(shapes[[a]] / _size(shapes), shapes[b] / _size(shapes))[0] >= 0.01


def _size(shapes: Reals) -> Reals:
    return np.sqrt(np.diag(information_of(shapes)))


def test_elimination_leaves_repetitions_out_before() -> None:
    shapes = _random(20, 3, 4)
    shapes[10:] = shapes[:10] + 0.001 * _random(10, 3, 4, 1)
    found = eliminate(Candidates(shapes), 5, threshold=0.05)
    assert len(set(found.chosen % 10)) == 5
    assert found.rejected >= 10


def test_fewer_sensors_where_all_others_repeat_them() -> None:
    shapes = np.repeat(_random(3, 1, 2), 5, axis=0)
    found = expand(Candidates(shapes), 6, threshold=0.01)
    assert len(found.chosen) == 3
    assert found.rejected == 12


def test_the_part_of_an_output_that_another_sensor_does_not_give() -> None:
    a, b = _random(1, 3, 8)[0], _random(1, 3, 8, 1)[0]
    # outputs under modal motion of equal mean squares; what is left after regression on the other sensor's outputs
    q = np.random.default_rng(2).standard_normal((8, 400_000))
    y, x = a @ q, b @ q
    left = y - (y @ x.T) @ np.linalg.inv(x @ x.T) @ x
    assert np.isclose(unlike(a[None], b)[0], (left**2).sum() / (y**2).sum(), atol=3e-3)
    # two uniaxial sensors: 1 − ρ²
    rho = a[0] @ b[0] / np.sqrt(a[0] @ a[0] * (b[0] @ b[0]))
    assert np.isclose(unlike(a[None, :1], b[:1])[0], 1.0 - rho**2)


def test_weights_move_the_choice() -> None:
    shapes = np.ones((3, 1, 1)) * np.array([1.0, 2.0, 1.5])[:, None, None]
    assert expand(Candidates(shapes), 1).chosen.tolist() == [1]
    assert expand(Candidates(shapes, np.array([9.0, 1.0, 1.0])), 1).chosen.tolist() == [0]


def test_modes_that_no_candidate_tells_apart_are_named() -> None:
    shapes = _random(9, 1, 4)
    shapes[:, :, 2] = 2.0 * shapes[:, :, 0]
    with pytest.raises(FemtuneError, match="target modes 7, 9 apart") as caught:
        expand(Candidates(shapes, names=("7", "8", "9", "10")), 5)
    assert caught.value.code == "plan.dependent"


def test_modes_that_do_not_move_at_the_candidates_are_named() -> None:
    shapes = _random(9, 1, 4)
    shapes[:, :, [1, 3]] *= 1e-11  # the residue of in-plane modes along the normal of a plate
    with pytest.raises(FemtuneError, match="target modes 8, 10 do not move") as caught:
        expand(Candidates(shapes, names=("7", "8", "9", "10")), 5)
    assert caught.value.code == "plan.dependent"
    # seen by a sensor that is there
    there = np.eye(4)[[1, 3]][:, None, :]
    assert len(expand(Candidates(shapes, names=("7", "8", "9", "10")), 3, (Placed(there, there),)).chosen) == 3


def test_elimination_that_would_lose_a_mode_is_refused() -> None:
    # four triaxial sensors, each of which alone sees one mode: none can be removed, though 2 × 3 ≥ 4
    shapes = np.zeros((4, 3, 4))
    shapes[np.arange(4), 0, np.arange(4)] = 1.0
    with pytest.raises(FemtuneError, match="none can be removed"):
        eliminate(Candidates(shapes), 2)


def test_the_condition_number_is_that_of_the_singular_values() -> None:
    shapes = _random(1, 9, 4)[0]
    found = outcome_of(shapes)
    assert np.isclose(found.condition, np.linalg.cond(shapes))
    assert np.isclose(found.log_det, 2.0 * np.log(np.linalg.svd(shapes, compute_uv=False)).sum())
    assert outcome_of(shapes[:, [0, 0, 1]]).condition == np.inf
    one = outcome_of(shapes[:, :1])
    assert (one.largest_off_diagonal, one.root_mean_square) == (0.0, 0.0)
