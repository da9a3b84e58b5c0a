"""Pairing: optimal, gated, fixed by hand, clusters as subspaces."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from femtune.correlation import no_pairs, pair_modes
from femtune.dofs import Dof, DofSet
from femtune.errors import FemtuneError
from femtune.modal import ModeSet, mac

TEST_HZ = np.array([10.0, 20.0, 30.0, 40.0])


def _modes(freq_hz: object, shapes: np.ndarray) -> ModeSet:
    dofs = DofSet(Dof(i + 1, "Z") for i in range(len(shapes)))
    return ModeSet(np.asarray(freq_hz, float), shapes, dofs)


def _orthonormal(n: int = 9, m: int = 4, seed: int = 0) -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(n, m)))[0]


def _turn(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s], [s, c]])


def test_swapped_modes_are_paired_by_shape_and_the_error_has_its_sign() -> None:
    phi = _orthonormal()
    found = pair_modes(_modes(TEST_HZ, phi), _modes([11.0, 22, 29, 38], phi[:, [1, 0, 2, 3]]), frequency_gate=1.5)
    assert found.key == ((0, 1), (1, 0), (2, 2), (3, 3))
    assert [p.frequency_error for p in found.pairs] == pytest.approx([1.2, -0.45, -1 / 30, -0.05])
    assert not found.unpaired_test
    assert not found.unpaired_model


@given(st.integers(0, 10**6), st.integers(2, 6), st.integers(0, 2), st.integers(1, 2))
@pytest.mark.slow
def test_pairs_keep_the_order_of_frequencies_where_shapes_do_not_decide(
    seed: int, t: int, more: int, rows: int
) -> None:
    """One sensor, or sensors at which all modes have one shape: every MAC is one."""
    rng = np.random.default_rng(seed)
    one = rng.normal(size=(rows, 1))
    test = _modes(np.sort(100.0 + 60.0 * rng.random(t)), one * rng.choice([-1.0, 2.0], t))
    model = _modes(np.sort(90.0 + 80.0 * rng.random(t + more)), one * rng.choice([-3.0, 1.0], t + more))
    found = pair_modes(test, model, frequency_gate=1.0)
    assert len(found.pairs) == t
    assert list(found.model_indices) == sorted(found.model_indices)


def test_order_decides_below_the_noise_of_a_mac_and_shape_above_it() -> None:
    """Two modes whose shapes differ by an angle, in opposite order: crossed where sin² of it exceeds 0.1 ln²(f₂/f₁)."""
    for degrees, crossed in ((1.0, False), (4.0, True)):
        shapes = np.column_stack([_turn(0.0)[0], _turn(degrees)[0]])
        found = pair_modes(_modes([100.0, 108.0], shapes), _modes([99.0, 107.0], shapes[:, ::-1]), relative_gap=0.001)
        assert (found.key == ((0, 1), (1, 0))) == crossed, degrees


@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 4), st.floats(0.0, 0.9))
@pytest.mark.slow
def test_the_assignment_is_the_best_of_all_permutations(seed: int, t: int, m: int, gate: float) -> None:
    rng = np.random.default_rng(seed)
    test = _modes(10 + 20 * rng.random(t), rng.normal(size=(5, t)))
    model = _modes(np.linspace(12, 30, m), rng.normal(size=(5, m)))
    found = pair_modes(test, model, frequency_gate=0.4, mac_gate=gate)
    score = mac(test.shapes, model.shapes)
    near = np.abs(model.freq_hz / test.freq_hz[:, None] - 1) <= 0.4
    farther = 0.1 * np.log(model.freq_hz / test.freq_hz[:, None]) ** 2
    worth = np.where(near & (score >= gate), np.maximum(score - farther, 1e-9), 0.0)
    worth = np.pad(worth, ((0, max(0, m - t)), (0, max(0, t - m))))
    best = max(sum(worth[i, j] for i, j in enumerate(p)) for p in itertools.permutations(range(len(worth))))
    reached = sum(max(pair.mac - farther[pair.test, pair.model], 1e-9) for pair in found.pairs)
    assert reached == pytest.approx(best, abs=1e-7)
    assert all(pair.mac >= gate and abs(pair.frequency_error) <= 0.4 for pair in found.pairs)
    _is_partition(found, t, m)


def _is_partition(found: object, t: int, m: int) -> None:
    """Every mode is in exactly one place."""
    tests = [*found.test_indices, *(u.test for u in found.unpaired_test)]  # type: ignore[attr-defined]
    models = [*found.model_indices, *found.unpaired_model]  # type: ignore[attr-defined]
    assert sorted(tests) == list(range(t))
    assert sorted(models) == list(range(m))


@settings(max_examples=30)
@given(st.permutations(range(4)), st.permutations(range(5)))
@pytest.mark.slow
def test_the_order_of_modes_does_not_matter(rows: list[int], columns: list[int]) -> None:
    rng = np.random.default_rng(3)
    test = _modes(TEST_HZ, rng.normal(size=(8, 4)))
    noise = 0.3 * rng.normal(size=(8, 5))
    model = _modes(
        [10.0, 20, 20.1, 31, 39], np.column_stack([test.shapes, test.shapes[:, 1]])[:, [0, 1, 4, 2, 3]] + noise
    )
    plain = pair_modes(test, model)
    mixed = pair_modes(test.select_modes(rows), model.select_modes(columns))
    assert {(rows[i], columns[j]) for i, j in mixed.key} == set(plain.key)
    by_test = {rows[p.test]: p.mac for p in mixed.pairs}
    assert [by_test[p.test] for p in plain.pairs] == pytest.approx([p.mac for p in plain.pairs])


def test_optimal_beats_greedy() -> None:
    # test 1 likes model 1 best, but test 2 has nothing else
    a, b = 0.75, 0.7
    shapes = np.eye(3)[:, :2]
    second = np.array([np.sqrt(0.6), 0.0, np.sqrt(0.4)])
    first = np.array([np.sqrt(a), np.sqrt(1 - a), 0.0])
    model = np.column_stack([first, np.array([np.sqrt(b), 0.0, -np.sqrt(1 - b)])])
    test = np.column_stack([shapes[:, 0], second])
    found = pair_modes(_modes([10.0, 10.5], test), _modes([10.0, 11.0], model), mac_gate=0.4)
    assert found.key == ((0, 1), (1, 0))


def test_gates_and_their_words() -> None:
    phi = _orthonormal(m=5)
    mixed = 0.6 * phi[:, 2] + 0.8 * phi[:, 4]
    test = _modes([10.0, 20, 30], np.column_stack([phi[:, 0], phi[:, 1], mixed]))
    model = _modes([10.5, 27.0, 33.0], phi[:, :3])
    found = pair_modes(test, model)
    assert found.key == ((0, 0),)
    reasons = {u.test: u.reason for u in found.unpaired_test}
    assert "model mode 2 (27 Hz): MAC 1.00, frequency error +35.0 %" in reasons[1]
    assert reasons[1].endswith(" frequency gate of 30 %")
    assert "model mode 3 (33 Hz): MAC 0.36, frequency error +10.0 %" in reasons[2]
    assert reasons[2].endswith(" MAC gate of 0.50")
    assert found.unpaired_model == (1, 2)


def test_a_taken_candidate_is_named() -> None:
    phi = _orthonormal()
    test = _modes([10.0, 10.5], np.column_stack([phi[:, 0], phi[:, 0] + 0.5 * phi[:, 3]]))
    found = pair_modes(test, _modes([10.2], phi[:, :1]))
    assert found.key == ((0, 0),)
    assert found.unpaired_test[0].reason.endswith("it is paired with test mode 1")


def test_fixed_pairs_override_gates_and_are_flagged() -> None:
    phi = _orthonormal()
    test, model = _modes(TEST_HZ, phi), _modes(TEST_HZ, phi)
    found = pair_modes(test, model, fixed=((0, 3),))
    assert found.key == ((0, 3), (1, 1), (2, 2))
    assert [p.fixed for p in found.pairs] == [True, False, False]
    assert found.pairs[0].frequency_error == pytest.approx(3.0)
    assert found.pairs[0].mac == pytest.approx(0.0, abs=1e-12)
    assert found.unpaired_test[0].test == 3


def test_left_out_modes_keep_their_reason() -> None:
    phi = _orthonormal()
    found = pair_modes(_modes(TEST_HZ, phi), _modes(TEST_HZ, phi), left_out={2: "local mode of the cable"})
    assert found.key == ((0, 0), (1, 1), (3, 3))
    assert found.unpaired_test[0].reason == "local mode of the cable"
    assert found.unpaired_test[0].left_out
    assert found.unpaired_model == (2,)


@pytest.mark.parametrize(
    ("fixed", "left_out", "code"),
    [
        (((9, 0),), {}, "correlate.fixed-pair"),
        (((0, 9),), {}, "correlate.fixed-pair"),
        (((0, 1), (2, 1)), {}, "correlate.fixed-pair"),
        ((), {7: "x"}, "correlate.left-out"),
        ((), {1: " "}, "correlate.left-out"),
        (((1, 1),), {1: "noisy"}, "correlate.left-out"),
    ],
)
def test_impossible_requests(fixed: tuple, left_out: dict, code: str) -> None:
    phi = _orthonormal()
    with pytest.raises(FemtuneError) as caught:
        pair_modes(_modes(TEST_HZ, phi), _modes(TEST_HZ, phi), fixed=fixed, left_out=left_out)
    assert caught.value.code == code


def test_different_sensors_are_refused() -> None:
    phi = _orthonormal()
    model = _modes(TEST_HZ, phi)
    with pytest.raises(FemtuneError, match=r"correlate\.dofs-differ"):
        pair_modes(model.select_dofs(model.dofs.select(range(5))), model)


@pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0, 90.0, 133.0])
def test_repeated_modes_are_rotated_to_the_test(degrees: float) -> None:
    phi = _orthonormal()
    test = _modes(TEST_HZ, np.column_stack([phi[:, 0], 3 * phi[:, 1:3] @ _turn(degrees), phi[:, 3]]))
    found = pair_modes(test, _modes([10.0, 25.0, 25.0, 40.0], phi))
    assert [p.mac for p in found.pairs] == pytest.approx([1.0] * 4)
    match = found.clusters[0]
    assert (match.test, match.model) == ((1, 2), (1, 2))
    folded = min(degrees % 90, 90 - degrees % 90)
    assert match.rotation.angle_deg == pytest.approx(folded, abs=1e-5)
    assert found.pairs[1].mac_unrotated == pytest.approx(np.cos(np.radians(folded)) ** 2)
    assert [p.cluster for p in found.pairs] == [None, 0, 0, None]


def test_own_vectors_of_a_rotated_pair_would_have_failed_the_gate() -> None:
    phi = _orthonormal()
    test = _modes([20.0, 20.1], phi[:, :2] @ _turn(45.0))
    model = _modes([20.0, 20.0], phi[:, :2])
    assert [p.mac for p in pair_modes(test, model, mac_gate=0.9).pairs] == pytest.approx([1.0, 1.0])
    assert not pair_modes(test, model, mac_gate=0.9, relative_gap=-1.0).pairs


def test_three_repeated_modes_with_complex_phases_gaps_and_noise() -> None:
    rng = np.random.default_rng(5)
    phi = _orthonormal(n=20, m=5)
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    shapes = phi.copy().astype(complex)
    shapes[:, 1:4] = phi[:, 1:4] @ q * np.exp(1j * np.array([0.3, 2.0, -1.0]))
    shapes += 0.005 * (rng.normal(size=shapes.shape) + 1j * rng.normal(size=shapes.shape))
    shapes[rng.random(shapes.shape) < 0.05] = np.nan
    found = pair_modes(_modes([10.0, 20, 20.01, 20.02, 30], shapes), _modes([10.0, 20, 20, 20, 30], phi))
    assert len(found.pairs) == 5
    assert min(p.mac for p in found.pairs) > 0.995
    assert found.clusters[0].test == (1, 2, 3)
    assert max(found.clusters[0].rotation.principal_angles_deg) < 4.0


def test_a_noisy_plate_pair() -> None:
    # (2,1) and (1,2) of a square simply supported plate, turned by 30 degrees, seen by 25 sensors
    grid = (np.arange(5) + 1) / 6
    x, y = (v.ravel() for v in np.meshgrid(grid, grid))
    both = [np.sin(i * np.pi * x) * np.sin(j * np.pi * y) for i, j in ((1, 1), (2, 1), (1, 2), (2, 2))]
    model = _modes([2.0, 5.0, 5.0, 8.0], np.column_stack(both))
    rng = np.random.default_rng(1)
    shapes = model.shapes.copy()
    shapes[:, 1:3] = shapes[:, 1:3] @ _turn(30.0)
    found = pair_modes(_modes([2.02, 4.99, 5.02, 8.1], shapes + 0.03 * rng.normal(size=shapes.shape)), model)
    assert found.key == ((0, 0), (1, 1), (2, 2), (3, 3))
    assert min(p.mac for p in found.pairs) > 0.98
    assert found.clusters[0].rotation.angle_deg == pytest.approx(30.0, abs=2.0)
    assert [p.mac_unrotated for p in found.pairs[1:3]] == pytest.approx([0.75, 0.75], abs=0.05)


def test_one_test_mode_of_a_repeated_pair() -> None:
    phi = _orthonormal()
    test = _modes([20.0], phi[:, :2] @ [[0.6], [0.8]])
    found = pair_modes(test, _modes([20.0, 20.0], phi[:, :2]))
    assert found.key == ((0, 1),)
    assert found.pairs[0].mac == pytest.approx(1.0)
    assert found.unpaired_model == (0,)


def test_the_same_shape_twice_gets_one_partner() -> None:
    phi = _orthonormal()
    shape = phi[:, 0] + 0.2 * phi[:, 1]
    twice = np.column_stack([shape, shape + 0.05 * phi[:, 2]])
    found = pair_modes(_modes([20.0, 20.1], twice), _modes([20.0, 20.0], phi[:, :2]), mac_gate=0.6)
    assert [p.test for p in found.pairs] == [0]
    assert found.pairs[0].mac == pytest.approx(1.0)
    assert "the MAC after rotation within its cluster is 0.5" in found.unpaired_test[0].reason


def test_a_pair_fixed_inside_a_cluster_keeps_its_member() -> None:
    phi = _orthonormal()
    test = _modes([20.0, 20.1], phi[:, :2])
    found = pair_modes(test, _modes([20.0, 20.0], phi[:, :2]), fixed=((0, 1),))
    assert found.key == ((0, 1), (1, 0))
    assert [p.mac for p in found.pairs] == pytest.approx([1.0, 1.0])


def test_a_cluster_as_large_as_the_sensors_is_not_a_subspace() -> None:
    phi = np.linalg.qr(np.random.default_rng(8).normal(size=(2, 2)))[0]
    found = pair_modes(_modes([20.0], phi @ [[0.6], [0.8]]), _modes([20.0, 20.0], phi))
    assert not found.clusters
    assert found.pairs[0].mac == pytest.approx(0.64)
    assert found.notices[0].code == "correlate.crowded-cluster"


def test_modes_that_the_sensors_do_not_see_stay_unpaired() -> None:
    phi = _orthonormal()
    phi[:, 2] = 1e-14 * phi[:, 0]
    found = pair_modes(_modes([10.0, 10.0], phi[:, :2]), _modes([10.0, 12.0, 10.05, 12.05], phi))
    assert found.key == ((0, 0), (1, 1))
    assert found.unpaired_model == (2, 3)


def test_missing_entries_do_not_hinder() -> None:
    phi = _orthonormal(n=12)
    shapes = phi.copy()
    shapes[[0, 3, 7], [0, 1, 2]] = np.nan
    found = pair_modes(_modes(TEST_HZ, shapes), _modes(TEST_HZ, phi))
    assert [p.mac for p in found.pairs] == pytest.approx([1.0] * 4)


def test_a_test_shape_that_no_model_mode_shares() -> None:
    shapes = np.array([[1.0, np.nan], [np.nan, 1.0]])
    found = pair_modes(_modes([1.0, 2.0], shapes), _modes([2.0], np.array([[0.0], [1.0]])))
    assert found.key == ((1, 0),)
    assert found.unpaired_test[0].reason == "all model modes are zero at the measured DOFs of this mode"


def test_no_pairs_is_a_result() -> None:
    phi = _orthonormal()
    test = _modes([10.0, 20.0], phi[:, :2])
    found = pair_modes(test, _modes([100.0], phi[:, 3:]))
    assert found.pairs == ()
    error = no_pairs(test, {u.test: u.reason for u in found.unpaired_test})
    assert error.code == "correlate.no-pairs"
    assert len(error.values) == 2


def test_a_model_without_modes() -> None:
    found = pair_modes(_modes([10.0], np.ones((3, 1))), _modes([], np.zeros((3, 0))))
    assert found.unpaired_test[0].reason == "all model modes are zero at the measured DOFs of this mode"


def test_a_test_at_zero_hertz_has_no_relative_error() -> None:
    phi = _orthonormal(m=2)
    found = pair_modes(_modes([0.0, 5.0], phi), _modes([0.1, 5.0], phi))
    assert found.key == ((1, 1),)


@pytest.mark.parametrize("gates", [(30.0, 0.5), (0.3, 50.0), (0.0, 0.5), (np.nan, 0.5), (0.3, np.nan)])
def test_gates_are_fractions(gates: tuple[float, float]) -> None:
    phi = _orthonormal()
    with pytest.raises(FemtuneError, match=r"correlate\.gate"):
        pair_modes(_modes(TEST_HZ, phi), _modes(TEST_HZ, phi), frequency_gate=gates[0], mac_gate=gates[1])


@pytest.mark.parametrize("gate", [0.0, 1.0])
def test_the_ends_of_the_range_are_gates(gate: float) -> None:
    """Unit vectors have MACs of 0 and 1 exactly."""
    modes = _modes(TEST_HZ, np.eye(len(TEST_HZ)))
    assert pair_modes(modes, modes, mac_gate=gate).key == tuple((i, i) for i in range(len(TEST_HZ)))


def test_no_frequency_gate_at_all() -> None:
    phi = _orthonormal()
    assert len(pair_modes(_modes(TEST_HZ, phi), _modes(10 * TEST_HZ, phi), frequency_gate=np.inf).pairs) == 4


@pytest.mark.parametrize("model_hz", [[9.0, 10.2], [10.2, 9.0]])
def test_equal_shapes_go_to_the_nearer_frequency(model_hz: list[float]) -> None:
    phi = _orthonormal()
    found = pair_modes(_modes([10.0], phi[:, :1]), _modes(model_hz, phi[:, [0, 0]]))
    assert found.key == ((0, model_hz.index(10.2)),)


def test_a_cluster_that_straddles_the_gate_gives_its_member_inside() -> None:
    phi = _orthonormal()
    found = pair_modes(_modes([20.0], phi[:, 1:2]), _modes([24.9, 25.1], phi[:, :2]), frequency_gate=0.25)
    assert found.key == ((0, 0),)
    assert found.pairs[0].mac == pytest.approx(1.0)
    assert abs(found.pairs[0].frequency_error) <= 0.25


def test_a_pair_that_is_forbidden_is_not_made_and_is_named() -> None:
    phi = _orthonormal()
    model = _modes(TEST_HZ, phi)
    found = pair_modes(_modes(TEST_HZ, phi), model, never=((1, 1), (3, 9)))
    assert found.key == ((0, 0), (2, 2), (3, 3))
    (alone,) = found.unpaired_test
    assert alone.reason.endswith(f"; the study forbids its pair with model mode {model.labels[1]}")
    assert found.unpaired_model == (1,)


def test_a_forbidden_pair_gives_way_to_the_next_best() -> None:
    phi = _orthonormal()
    test = _modes(TEST_HZ, np.column_stack([phi[:, 0], 0.8 * phi[:, 1] + 0.6 * phi[:, 2], *phi[:, 2:].T]))
    assert pair_modes(test, _modes(TEST_HZ, phi), mac_gate=0.3, frequency_gate=0.6).key[1] == (1, 1)
    found = pair_modes(test, _modes(TEST_HZ, phi), mac_gate=0.3, frequency_gate=0.6, never=((1, 1), (2, 2)))
    assert found.key == ((0, 0), (1, 2), (3, 3))


def test_a_forbidden_member_forbids_the_whole_cluster() -> None:
    phi = _orthonormal()
    test, model = _modes([20.0, 20.1], phi[:, :2]), _modes([20.0, 20.0], phi[:, :2])
    found = pair_modes(test, model, never=((0, 1), (0, 0)))
    assert (found.key, found.groups) == (((1, 1),), ((0, 1),))
    (told,) = (n for n in found.notices if n.code == "correlate.never-cluster")
    assert f"test mode {test.labels[0]} is paired with none of them" in told.what
    assert found.unpaired_test[0].reason.endswith("and so with its whole cluster")


def test_a_forbidden_pair_without_shapes_keeps_the_order_of_the_others() -> None:
    test, model = (ModeSet(TEST_HZ, np.zeros((0, 4)), DofSet([])) for _ in range(2))
    found = pair_modes(test, model, never=((1, 1),))
    assert found.key == ((0, 0), (2, 2), (3, 3))
    (alone,) = found.unpaired_test
    assert (alone.test, alone.reason.split("; ")[1]) == (1, "the study forbids it")
    assert found.unpaired_model == (1,)
