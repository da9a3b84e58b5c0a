"""Exciters, frequency lines, sensor masses and suspension, against closed forms and independent solutions."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.planning import (
    calibration_lines,
    driving_point_levels,
    mode_indicator,
    place_exciters,
    rayleigh_with_masses,
    record_length,
    suspended,
)


def _chain(n: int = 8, ground: bool = True) -> tuple[Reals, Reals]:
    """Stiffness and mass matrices of a chain of unit springs and masses that rise from 1 to 2."""
    K = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[-1, -1] = 1.0
    if not ground:
        K[0, 0] = 1.0
    return K, np.diag(np.linspace(1.0, 2.0, n))


def test_levels_are_residues_relative_to_the_best_point() -> None:
    K, M = _chain()
    _, shapes = la.eigh(K, M)
    levels = driving_point_levels(shapes)
    assert np.allclose(levels.max(axis=0), 1.0)
    assert np.isclose(levels[2, 4], shapes[2, 4] ** 2 / max(shapes[:, 4] ** 2))


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("seed", range(6))
def test_exciters_beside_the_best_of_all_sets(count: int, seed: int) -> None:
    levels = driving_point_levels(np.random.default_rng(seed).standard_normal((14, 5)))
    best = max(levels[list(some)].max(axis=0).min() for some in combinations(range(14), count))
    found = levels[place_exciters(levels, count)].max(axis=0).min()
    # one exciter is found exactly; sets by exchange come near
    assert found >= best * (1.0 - 1e-3 if count == 1 else 0.6)
    assert found <= best + 1e-12


def test_given_exciters_leave_what_they_do_not_excite_to_others() -> None:
    levels = np.eye(3)
    assert place_exciters(levels, 1, given=np.array([[1.0, 1.0, 0.0]])).tolist() == [2]
    assert len(place_exciters(levels, 9)) == 3


def test_the_mode_indicator_of_one_degree_of_freedom() -> None:
    # H = 1/(k − ω² + ic): Re²/|H|² = (λ − ω²)²/((λ − ω²)² + (2ξω₀ω)²)
    lam, ratio = (2.0 * np.pi * 10.0) ** 2, 0.02
    hz = np.array([8.0, 9.9, 10.0, 10.3])
    one = np.ones((1, 1))
    found = mode_indicator(hz, np.array([lam]), ratio, one, one)
    w = 2.0 * np.pi * hz
    exact = (lam - w**2) ** 2 / ((lam - w**2) ** 2 + (2.0 * ratio * np.sqrt(lam) * w) ** 2)
    np.testing.assert_allclose(found, exact, atol=1e-10)


def test_the_mode_indicator_of_two_inputs_finds_a_repeated_mode() -> None:
    # two modes of one frequency: one force excites one combination of them, two forces both
    lam = np.full(2, (2.0 * np.pi * 5.0) ** 2)
    shapes = np.array([[1.0, 0.2], [0.3, 1.0], [0.5, -0.7]])
    both = mode_indicator(np.array([5.0, 7.0]), lam, 0.01, shapes, shapes[:2])
    assert both[0] < 1e-9
    assert both[1] > 0.98


def test_lines_are_close_enough_everywhere() -> None:
    for low, high, ratio, per in ((55.0, 430.0, 0.002, 3), (5.0, 6.0, 0.01, 1), (20.0, 420.0, 0.02, 3)):
        lines = calibration_lines(low, high, ratio, per)
        assert lines[[0, -1]] == pytest.approx([low, high])
        half_bands = np.diff(lines) / (2.0 * ratio * lines[:-1])
        assert half_bands.max() <= 1.0 / per + 1e-12
        # one line fewer would be too few
        fewer = np.geomspace(low, high, len(lines) - 1)
        assert len(fewer) < 2 or (np.diff(fewer) / (2.0 * ratio * fewer[:-1])).max() > 1.0 / per


def test_a_record_that_resolves_the_lowest_mode() -> None:
    found = record_length(10.0, 110.0, 20.0, 0.01, 4)
    assert found.spacing_hz == pytest.approx(0.1)
    assert found.duration_s == pytest.approx(10.0)
    assert found.lines == 1001
    # the envelope exp(−ξωt)
    assert np.exp(-0.01 * 2.0 * np.pi * 20.0 * found.decay_s) == pytest.approx(1e-3)


def test_small_masses_shift_frequencies_as_the_rayleigh_quotient_says() -> None:
    K, M = _chain()
    lam, shapes = la.eigh(K, M)
    motion = np.zeros((2, 3, 8))
    motion[:, 0] = shapes[[2, 6]]
    masses = 1e-4 * np.array([1.0, 3.0])
    loaded = M.copy()
    loaded[2, 2] += masses[0]
    loaded[6, 6] += masses[1]
    exact = la.eigh(K, loaded, eigvals_only=True)
    found = rayleigh_with_masses(lam, masses, motion)
    np.testing.assert_allclose(found - lam, exact - lam, rtol=2e-3)
    # an upper bound of the lowest eigenvalue
    assert found[0] >= exact[0]


def test_a_suspension_beside_the_whole_problem() -> None:
    K, M = _chain(ground=False)
    lam, shapes = la.eigh(K, M)
    springs, motion = np.zeros((2, 3)), np.zeros((2, 3, 8))
    springs[:, 0] = 0.01, 0.02
    motion[:, 0] = shapes[[0, 7]]
    hung = K + np.diag([0.01, 0, 0, 0, 0, 0, 0, 0.02])
    exact = la.eigh(hung, M, eigvals_only=True)
    found = suspended(lam, 1, springs, motion)
    np.testing.assert_allclose(found.rigid, exact[:1], rtol=1e-10)
    np.testing.assert_allclose(found.elastic, exact[1:], rtol=1e-10)
    # bounce on the sum of the springs, to first order
    assert found.rigid[0] == pytest.approx(0.03 / np.trace(M), rel=0.05)


def test_a_suspension_that_is_stiffer_than_the_structure() -> None:
    K, M = _chain(ground=False)
    lam, shapes = la.eigh(K, M)
    springs, motion = np.zeros((1, 3)), np.zeros((1, 3, 8))
    springs[0, 0] = 50.0
    motion[0, 0] = shapes[3]
    found = suspended(lam, 1, springs, motion)
    exact = la.eigh(K + np.diag([0, 0, 0, 50.0, 0, 0, 0, 0]), M, eigvals_only=True)
    np.testing.assert_allclose(np.sort([*found.rigid, *found.elastic]), exact, rtol=1e-9)
