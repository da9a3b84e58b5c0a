"""Whether nominally identical specimens differ by more than the uncertainty of what is known of each.

Sources: W. G. Cochran, The Combination of Estimates from Different Experiments, Biometrics 10, 1954 (the χ² test of
homogeneity); R. DerSimonian, N. Laird, Meta-analysis in clinical trials, Controlled Clinical Trials 7, 1986 (the
variance that is left); S. Holm, A Simple Sequentially Rejective Multiple Test Procedure, Scandinavian Journal of
Statistics 6, 1979.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.special import chdtrc, fdtrc

from femtune.arrays import Reals

SIGNIFICANCE = 0.05
"""Probability below which a spread is called real."""
PAPERS = ("cochran1954", "dersimonian1986", "holm1979")


@dataclass(frozen=True)
class Spread:
    """The spread of one quantity over specimens.

    Parameters
    ----------
    mean, sd : of the values; the standard deviation with n − 1
    stated_sd : what the uncertainty of the values alone makes of the standard deviation, on the average
    real_sd : the rest, √(sd² − stated_sd²); 0 where nothing is left
    chi_square, freedom, p_value : of the test that all specimens have the same value
    """

    mean: float
    sd: float
    stated_sd: float
    real_sd: float
    chi_square: float
    freedom: int
    p_value: float

    @property
    def cov(self) -> float:
        """Coefficient of variation sd/|mean|; NaN where the mean is zero."""
        return self.sd / abs(self.mean) if self.mean else float("nan")


def spread_of(values: Reals, covariance: Reals) -> Spread:
    """The spread of values (n,), n ≥ 2, with a positive definite covariance (n, n) of their errors.

    Examples
    --------
    >>> import numpy as np
    >>> found = spread_of(np.array([1.0, 1.2, 1.1]), 0.01**2 * np.eye(3))
    >>> round(found.sd, 3), round(found.real_sd, 4), round(found.chi_square)
    (0.1, 0.0995, 200)
    """
    n = len(values)
    mean, sd = float(np.mean(values)), float(np.std(values, ddof=1))
    centred = covariance - covariance.mean(axis=0)
    stated = float(np.trace(centred)) / (n - 1)
    factor = la.cho_factor(covariance)
    one = la.cho_solve(factor, np.ones(n))
    off = values - float(one @ values) / float(one.sum())
    chi_square = float(off @ la.cho_solve(factor, off))
    real = float(np.sqrt(max(sd**2 - stated, 0.0)))
    return Spread(mean, sd, float(np.sqrt(stated)), real, chi_square, n - 1, float(chdtrc(n - 1, chi_square)))


def adjusted(p_values: Sequence[float]) -> list[float]:
    """p-values for several tests at once, by Holm's procedure.

    Examples
    --------
    >>> [round(p, 3) for p in adjusted([0.01, 0.04, 0.03])]
    [0.03, 0.06, 0.06]
    """
    order = np.argsort(p_values, kind="stable")
    out, largest = [0.0] * len(p_values), 0.0
    for i, at in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - i) * p_values[at]))
        out[int(at)] = largest
    return out


@dataclass(frozen=True)
class CommonTest:
    """The test that parameters are common to all specimens.

    Parameters
    ----------
    increase : by how much the sum of squares of the joint calibration exceeds those of separate ones together
    restrictions : number of parameters that the joint calibration has fewer
    p_value : that chance makes it as large
    scaled : whether residuals larger than stated are taken into account: an F test then
    """

    increase: float
    restrictions: int
    p_value: float
    scaled: bool


def common_test(joint: float, separate: float, restrictions: int, freedom: int) -> CommonTest:
    """Likelihood ratio of a joint calibration and separate ones.

    Parameters
    ----------
    joint, separate : sums of squares at the ends
    restrictions : number of common parameters times (specimens − 1)
    freedom : residuals less parameters of the separate calibrations together

    Examples
    --------
    >>> common_test(22.0, 20.0, 2, 20).p_value > 0.3
    True
    """
    increase = max(joint - separate, 0.0)
    if freedom > 0 and separate > freedom:
        ratio = increase / restrictions / (separate / freedom)
        return CommonTest(increase, restrictions, float(fdtrc(restrictions, freedom, ratio)), True)
    return CommonTest(increase, restrictions, float(chdtrc(restrictions, increase)), False)


def common_test_of_estimates(values: Sequence[Reals], covariances: Sequence[Reals]) -> CommonTest:
    """The same from separate estimates and the covariances of their errors (Wald test).

    It is for residuals whose errors are not independent, such as those of identified tests: their sums of squares have
    no known distribution, but the estimates have.

    Parameters
    ----------
    values : (k,) of each specimen, the same parameters
    covariances : (k, k) positive definite, of each specimen

    Examples
    --------
    >>> import numpy as np
    >>> one = 0.01 * np.eye(2)
    >>> found = common_test_of_estimates([np.array([1.0, 2.0]), np.array([1.1, 2.0])], [one, one])
    >>> round(found.increase, 3), found.restrictions
    (0.5, 2)
    """
    inverses = [np.linalg.inv(one) for one in covariances]
    weighted = np.sum([inverse @ value for inverse, value in zip(inverses, values)], axis=0)
    mean = np.linalg.solve(np.sum(inverses, axis=0), weighted)
    off = [value - mean for value in values]
    increase = float(sum(d @ inverse @ d for d, inverse in zip(off, inverses)))
    restrictions = len(mean) * (len(values) - 1)
    return CommonTest(increase, restrictions, float(chdtrc(restrictions, increase)), False)
