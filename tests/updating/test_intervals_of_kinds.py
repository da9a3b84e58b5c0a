"""Intervals of a linear problem hold the truth as often as they say, whatever standard deviations are stated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from femtune.updating.covariance import parameter_covariance

_TESTS = 120
_ONCE_IN_A_THOUSAND = 1e-3


def coverage(values: dict[str, int], times: dict[str, float], tests: int, seed: int) -> tuple[float, float]:
    """Share of the intervals that contain the truth, and their mean width.

    Parameters
    ----------
    values : number of values of each kind; three parameters determine all of them
    times : actual over stated standard deviation of each kind
    """
    rng = np.random.default_rng(seed)
    kinds = [kind for kind, count in values.items() for _ in range(count)]
    J = rng.standard_normal((len(kinds), 3))
    size, inverse = np.array([times[kind] for kind in kinds]), np.linalg.pinv(J)
    held, width = 0, 0.0
    for _ in range(tests):
        e = size * rng.standard_normal(len(kinds))
        change = -inverse @ e
        found = parameter_covariance(e + J @ change, J, kinds, np.zeros((0, 3)), np.zeros(3, bool), np.ones(3))
        half = found.coverage_factor() * found.sd
        held += int((np.abs(change) <= half).sum())
        width += float(half.mean())
    return held / (3 * tests), width / tests


_CHAIN = {"frequency": 6, "shape": 30}
_RIGHT = {"frequency": 1.0, "shape": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("times", "least", "most"),
    [
        (_RIGHT, 0.93, 0.97),
        ({"frequency": 3.0, "shape": 3.0}, 0.93, 1.0),
        ({"frequency": 1.0, "shape": 3.0}, 0.93, 1.0),
        ({"frequency": 0.6, "shape": 0.67}, 0.93, 1.0),
    ],
    ids=["right", "three times too small", "shapes too small", "as init guesses"],
)
def test_intervals_hold_the_truth(times: dict[str, float], least: float, most: float) -> None:
    found, _ = coverage(_CHAIN, times, _TESTS, 1)
    # intervals of one test are not independent: the band is that of the tests, not of all intervals
    low = binom.ppf(_ONCE_IN_A_THOUSAND, _TESTS, least) / _TESTS
    high = binom.isf(_ONCE_IN_A_THOUSAND, _TESTS, most) / _TESTS
    assert low <= found <= high


def test_intervals_of_four_degrees_of_freedom_hold_the_truth() -> None:
    found, _ = coverage({"frequency": 7}, {"frequency": 3.0}, _TESTS, 2)
    assert found >= binom.ppf(_ONCE_IN_A_THOUSAND, _TESTS, 0.93) / _TESTS


def test_deviations_that_are_too_large_narrow_nothing() -> None:
    _, right = coverage(_CHAIN, _RIGHT, 60, 3)
    held, wide = coverage(_CHAIN, {"frequency": 1 / 3, "shape": 1 / 3}, 60, 3)
    assert held == 1.0
    # in units of the stated deviations, which are three times those of the data
    assert 0.85 * right < wide <= right
