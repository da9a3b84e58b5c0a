"""The normal distribution between two bounds beside digits of a longer arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from femtune.truncated_normal import line_sample, log_mass, mean_between

# a, b, logarithm of the probability, mean: with 60 digits by an independent library
EXACT = [
    (-1.96, 1.96, -0.051288863130464223, 0.0),
    (0.5, 0.5001, -10.254303906743445, 0.50004999958329166),
    (0.25, 0.25000001, -19.370869278933394, 0.250000005),
    (-5.0, 3.0, -0.001351097003834711, -0.004436351586384508),
    (8.0, 8.5, -35.028792508579748, 8.1137359894965232),
    (30.0, 30.000001, -464.73446409010367, 30.000000499997501),
    (30.0, 90.0, -454.3212439563432, 30.033259667433677),
    (-7.0, 27.0, -1.279812543886654e-12, 9.1347204083762841e-12),
    (90.0, 90.0000000625, -4067.5070405147456, 90.000000031249974),
]


@pytest.mark.parametrize(("a", "b", "log", "mean"), EXACT)
def test_the_probability_and_the_mean_between_two_bounds(a: float, b: float, log: float, mean: float) -> None:
    for low, high, sign in ((a, b, 1.0), (-b, -a, -1.0)):
        assert float(log_mass(low, high)) == pytest.approx(log, rel=1e-13, abs=1e-13)
        # to the digits of the distance of the mean from the bounds
        assert float(mean_between(low, high)) == pytest.approx(sign * mean, rel=1e-14, abs=1e-12)


def test_quantiles_are_those_of_scipy() -> None:
    share = np.linspace(0.01, 0.99, 9)
    for a, b in ((-1.0, 2.0), (3.0, 9.0), (-30.0, -28.0)):
        found = line_sample(np.zeros(9), np.ones(9), np.full(9, a), np.full(9, b), share)
        np.testing.assert_allclose(found, truncnorm.ppf(share, a, b), rtol=1e-9)
