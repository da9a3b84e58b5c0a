"""A predicted frequency beside the measured one, and what part of the miss test and parameters explain by scatter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

Reals = NDArray[np.float64]

EXPLAINED = 0.05
"""A miss that scatter exceeds by chance less often than this is not called noise."""


@dataclass(frozen=True)
class FrequencyMiss:
    """(model − test)/test of one frequency beside its standard deviations; all relative to the test's frequency.

    Parameters
    ----------
    error : (model − test)/test
    test_sd : of the measured frequency
    parameter_sd : of the predicted one, by the covariance of the parameters; None where it is not known
    """

    error: float
    test_sd: float
    parameter_sd: float | None

    @property
    def sd(self) -> float:
        """Of the difference: test and prediction are independent, for the test was not used."""
        return float(np.hypot(self.test_sd, self.parameter_sd or 0.0))

    @property
    def z(self) -> float:
        """The miss in units of its standard deviation; infinite where nothing scatters."""
        return self.error / self.sd if self.sd > 0.0 else float(np.copysign(np.inf, self.error))

    @property
    def p_value(self) -> float:
        """Chance of a miss as large or larger by scatter alone (normal, two-sided)."""
        return float(erfc(abs(self.z) / np.sqrt(2.0)))

    @property
    def explained(self) -> bool:
        """True where scatter alone could be the whole miss."""
        return self.p_value >= EXPLAINED

    def __str__(self) -> str:
        known = self.parameter_sd is not None
        parts = f"test {_percent(self.test_sd)}"
        parts += f", parameters {_percent(self.parameter_sd or 0.0)}" if known else "; that of the parameters unknown"
        word = "could explain" if self.explained else "does not explain"
        return f"scatter (σ {_percent(self.sd)}: {parts}) {word} the miss of {_percent(abs(self.error))} ({self._z})"

    @property
    def _z(self) -> str:
        return f"{abs(self.z):.1f} σ" if np.isfinite(self.z) else "nothing scatters"


def _percent(value: float) -> str:
    return f"{100.0 * value:.2g} %" if value >= 5e-7 else "0 %"


def frequency_miss(error: float, gradient: Reals, covariance: Reals, test_sd: float) -> FrequencyMiss:
    """The miss of one predicted frequency.

    σ² of the prediction is gᵀ C g, with g = ∂(f/f_test)/∂x and C the covariance of the parameters.

    Parameters
    ----------
    error : (model − test)/test
    gradient : (k,) of the predicted frequency over the measured one
    covariance : (k, k) of the normalised parameters; NaN where it is not known
    test_sd : relative standard deviation of the measured frequency
    """
    used = np.flatnonzero(gradient)
    variance = float(gradient[used] @ covariance[np.ix_(used, used)] @ gradient[used])
    return FrequencyMiss(error, test_sd, float(np.sqrt(max(variance, 0.0))) if np.isfinite(variance) else None)
