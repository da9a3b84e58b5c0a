"""Error of a predicted frequency, and whether the uncertainty of test and parameters explains it."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.correlation import Correlation, NotTested, paired_shapes
from femtune.modal.shape_criteria import modal_scale_factor

EXPLAINED = 0.05
"""An error with a smaller probability than this is not explained by noise."""


@dataclass(frozen=True)
class FrequencyMiss:
    """(model − test)/test of one frequency beside its standard deviations; all relative to the test's frequency.

    Parameters
    ----------
    error : (model − test)/test
    test_sd : of the measured frequency
    parameter_sd : of the predicted one, by the covariance of the parameters; None if it is not known
    """

    error: float
    test_sd: float
    parameter_sd: float | None

    @property
    def sd(self) -> float:
        """Standard deviation of the difference: test and prediction are independent, because the test was not used."""
        return float(np.hypot(self.test_sd, self.parameter_sd or 0.0))

    @property
    def z(self) -> float:
        """The error in units of its standard deviation; infinite if that is zero."""
        return self.error / self.sd if self.sd > 0.0 else float(np.copysign(np.inf, self.error))

    @property
    def p_value(self) -> float:
        """Probability of at least this error by uncertainty alone (normal, two-sided)."""
        return math.erfc(abs(self.z) / math.sqrt(2.0))

    @property
    def explained(self) -> bool:
        """True if uncertainty alone could explain the error."""
        return self.p_value >= EXPLAINED

    def __str__(self) -> str:
        known = self.parameter_sd is not None
        parts = f"test {_percent(self.test_sd)}"
        parts += (
            f", parameters {_percent(self.parameter_sd or 0.0)}" if known else "; that of the parameters is not known"
        )
        word = "could explain" if self.explained else "does not explain"
        return (
            f"uncertainty (σ {_percent(self.sd)}: {parts}) {word} the error of {_percent(abs(self.error))} ({self._z})"
        )

    @property
    def _z(self) -> str:
        return f"{abs(self.z):.1f} σ" if np.isfinite(self.z) else "σ is zero"


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


# ----------------------------------------------------------------------------------------------------
# Held-out sensors: the model's shape, scaled on the sensors that were used, beside the test's at the others.


@dataclass(frozen=True)
class HeldOutSensors:
    """Shape errors at the held-out sensors, pair by pair.

    Parameters
    ----------
    sensors : labels of the held-out sensors
    labels : of the pairs, in words
    error : (p,) root mean square of ψ − cφ at the held-out sensors over that of ψ at all sensors; c is the modal scale
        factor of the sensors that were used. NaN where a pair has no entry to compare
    noise : (p,) expected error due to noise of the shape, NaN if not known
    """

    sensors: tuple[str, ...]
    labels: tuple[str, ...]
    error: Reals
    noise: Reals

    def worst(self) -> tuple[float, str, str] | NotTested:
        """The largest error, its pair, and what noise explains of it."""
        if not np.isfinite(self.error).any():
            return NotTested("no pair has a measured entry at the held-out sensors")
        at = int(np.nanargmax(self.error))
        return float(self.error[at]), self.labels[at], self._words(at)

    def _words(self, at: int) -> str:
        error, noise = self.error[at], self.noise[at]
        if not np.isfinite(noise):
            return ""
        word = "could explain" if error <= 2.0 * noise else "does not explain"
        return f"noise of the measured shape ({100 * noise:.2g} % on average) {word} it"


def held_out_sensors(c: Correlation, held: Collection[int], tests: Collection[int] | None = None) -> HeldOutSensors:
    """Errors of all pairs, or of those of some test modes, at the sensors of positions `held`."""
    rows = [k for k, p in enumerate(c.pairing.pairs) if tests is None or p.test in tests]
    psi, phi = (matrix[:, rows] for matrix in paired_shapes(c.test, c.model, c.pairing))
    out = np.zeros(len(c.dofs), dtype=bool)
    out[list(held)] = True
    scaled = phi * modal_scale_factor(psi[~out], phi[~out])
    size = np.sqrt(np.nanmean(np.abs(psi) ** 2, axis=0))
    sd = _sd(c)[:, [c.pairing.pairs[k].test for k in rows]]
    names = tuple(str(c.dofs[int(k)]) for k in np.flatnonzero(out))
    pairs = tuple(f"test mode {c.test.labels[c.pairing.pairs[k].test]}" for k in rows)
    return HeldOutSensors(names, pairs, _rms(psi[out] - scaled[out]) / size, _rms(sd[out]) / size)


def _sd(c: Correlation) -> Reals:
    return np.full(c.test.shapes.shape, np.nan) if c.test.shapes_sd is None else c.test.shapes_sd


def _rms(values: NDArray) -> Reals:
    """(p,) root mean square of the known entries; NaN without any."""
    known = ~np.isnan(values)
    total = np.sum(np.where(known, np.abs(values) ** 2, 0.0), axis=0)
    count = known.sum(axis=0)
    return np.where(count > 0, np.sqrt(total / np.maximum(count, 1)), np.nan)
