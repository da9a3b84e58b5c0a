"""Prediction of repeats that were held out: which ones, level, and what is noticed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from femtune.errors import FemtuneError
from femtune.uncertainty import Fit, check_held_out, held_out_repeats
from femtune.uncertainty.held_out import differences, whitening

G = np.array([[1.0, 0.2], [0.5, 1.0], [-0.3, 0.7]])
PROJECTION = G @ np.linalg.pinv(G)


def test_a_fraction_is_drawn_and_numbers_are_taken():
    drawn = held_out_repeats(20, 0.3, 1)
    assert drawn.sum() == 6
    assert np.array_equal(drawn, held_out_repeats(20, 0.3, 1))
    assert not np.array_equal(drawn, held_out_repeats(20, 0.3, 2))
    assert np.flatnonzero(held_out_repeats(6, (2, 6), 0)).tolist() == [1, 5]


@pytest.mark.parametrize(("held", "words"), [((7,), "repeat 7"), (0.01, "leaves no repeats"),
                                             ((1, 2, 3, 4, 5), "leaves no repeats")])  # fmt: skip
def test_nothing_to_hold_out(held, words):
    with pytest.raises(FemtuneError, match=words) as error:
        held_out_repeats(6, held, 0)
    assert error.value.code == "quantify.hold-out"


def test_differences_are_those_in_the_metric_of_the_prediction():
    rng = np.random.default_rng(0)
    held, C = rng.standard_normal((7, 2)), np.array([[2.0, 0.5], [0.5, 1.0]])
    W = whitening(C, 10**9)
    np.testing.assert_allclose(W.T @ C @ W, np.eye(2), atol=1e-7)
    gap, inverse = np.cov(held.T) - C, np.linalg.inv(C)
    means, covariance = differences(held, np.ones(2), C, 10**9)
    shift = held.mean(axis=0) - 1.0
    assert means == pytest.approx(np.sqrt(shift @ inverse @ shift), rel=1e-6)
    assert covariance == pytest.approx(np.sqrt(np.trace(gap @ inverse @ gap @ inverse)), rel=1e-6)


def _checked(z, held, noise=0.0):
    own, N = z[~held], noise**2 * np.eye(3)
    metric = np.cov(own.T)
    mean = 10.0 + PROJECTION @ (own.mean(axis=0) - 10.0)
    predicted = PROJECTION @ (metric - N) @ PROJECTION.T + N
    return check_held_out(z[held], Fit(len(own), mean, predicted, PROJECTION, N))


def _tests(n, seed, noise=0.0):
    rng = np.random.default_rng(seed)
    return 10.0 + rng.standard_normal((n, 2)) @ G.T + noise * rng.standard_normal((n, 3))


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.0, 0.4])
def test_level(noise):
    held = held_out_repeats(30, 0.3, 1)
    wrong = np.mean([not _checked(_tests(30, seed, noise), held, noise).agrees for seed in range(60)])
    assert wrong <= binom.ppf(1 - 1e-3, 60, 0.05) / 60


@pytest.mark.slow
def test_a_change_between_the_repeats_is_found():
    held = np.arange(30) >= 20
    z = _tests(30, 3)
    assert _checked(z, held).agrees
    z[held] += 1.5 * G[:, 0]
    found = _checked(z, held)
    assert not found.agrees
    assert found.mean_difference[0] > 1.0


@pytest.mark.slow
def test_noise_that_is_not_stated_is_found():
    """Two parameters for three outputs predict a singular covariance."""
    held = held_out_repeats(60, 0.3, 1)
    assert not _checked(_tests(60, 1, 0.5), held).agrees
    assert _checked(_tests(60, 1, 0.5), held, 0.5).agrees


@pytest.mark.slow
def test_few_held_out_repeats_are_not_tested():
    z = _tests(12, 0)
    z[0, 1] = np.nan
    assert _checked(z, np.arange(12) < 5) is None
    assert _checked(z, np.arange(12) < 6) is not None


@pytest.mark.slow
def test_outputs_without_predicted_variation_are_not_compared():
    """A parameter that has no effect on an output predicts a standard deviation of rounding size."""
    held, z = np.arange(30) >= 20, _tests(30, 3)
    own = z[~held]
    projection = np.diag([1.0, 1.0, 0.0])
    predicted = projection @ np.cov(own.T) @ projection + np.diag([0.0, 0.0, 1e-40])
    fit = Fit(len(own), own.mean(axis=0), predicted, projection, np.zeros((3, 3)))
    with np.errstate(all="raise"):
        found = check_held_out(z[held], fit)
    assert found is not None
    assert found.silent.tolist() == [False, False, True]
    assert np.isnan(found.mean_difference[2])
    assert np.abs(found.mean_difference[:2]).max() < 3.0
    alone = Fit(len(own), own[:, :2].mean(axis=0), predicted[:2, :2], np.eye(2), np.zeros((2, 2)))
    both = check_held_out(z[held][:, :2], alone)
    assert found.p_values == pytest.approx(both.p_values, abs=0.05)
    assert check_held_out(z[held], replace(fit, covariance=np.zeros((3, 3)))) is None


@pytest.mark.slow
def test_outputs_that_were_not_asked_for_are_not_compared():
    held, z = np.arange(30) >= 20, _tests(30, 3)
    own, shifted = z[~held], z[held] + [0.0, 0.0, 50.0]
    fit = Fit(len(own), own.mean(axis=0), np.cov(own.T), np.eye(3), np.zeros((3, 3)), np.array([True, True, False]))
    assert check_held_out(shifted, fit).agrees
    assert not check_held_out(shifted, replace(fit, compared=None)).agrees
