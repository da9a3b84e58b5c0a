"""Forward check: the updated distribution, propagated through the model, compared with the measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from femtune.arrays import Reals
from femtune.uncertainty.outputs import Counted, Outputs
from femtune.uncertainty.repeats import OutputStatistics, covariance_distance, factor
from femtune.uncertainty.stochastic import StochasticResult, latin_hypercube, propagate

_BEYOND_CHANCE = 3.0
"""Standard errors of the sample beyond which a difference is not chance (0.3 % of normal ones)."""
_TOLERATED_ERROR = 0.1
"""Relative error of the propagated moments that is tolerated whatever the number of repeats: samples and curvature of
the model."""
_LISTED = 3
"""Differences of up to this number of outputs have a sentence each."""


@dataclass(frozen=True)
class ForwardCheck:
    """A cloud of parameters (n, k), its outputs (n, m), and the measured ones.

    `solutions` is what it cost.
    """

    names: tuple[str, ...]
    theta: Reals
    z: Reals
    measured: OutputStatistics
    solutions: int

    @property
    def mean(self) -> Reals:
        """(m,) of the samples."""
        return np.asarray(self.z.mean(axis=0))

    @property
    def covariance(self) -> Reals:
        """(m, m) of the samples, with that of the measurement errors."""
        scatter = np.atleast_2d(np.cov(self.z.T))
        return scatter if self.measured.noise is None else scatter + self.measured.noise

    @property
    def sd(self) -> Reals:
        """(m,) of the samples."""
        return np.sqrt(np.diag(self.covariance))

    def with_noise(self, seed: int = 0) -> Reals:
        """(n, m) samples with measurement errors: what repeated tests of the model would show."""
        noise = self.measured.noise
        if noise is None:
            return self.z
        drawn = np.random.default_rng(seed).standard_normal(self.z.shape)
        return np.asarray(self.z + drawn @ factor(noise).T)

    @property
    def mean_error(self) -> Reals:
        """(m,) (samples − measured)/measured sd."""
        return np.asarray((self.mean - self.measured.mean) / self.measured.sd)

    @property
    def sd_error(self) -> Reals:
        """(m,) (samples − measured)/measured of the standard deviations."""
        return np.asarray(self.sd / self.measured.sd - 1.0)

    @property
    def covariance_error(self) -> float:
        """|C − C_m|/|C_m| in measured standard deviations."""
        return covariance_distance(self.covariance, self.measured.covariance)

    @property
    def chance_error(self) -> float:
        """Size of `covariance_error` between a covariance of the measured number of repeats and the true one.

        Of n normal repeats E|S − C|² = (|C|² + (tr C)²)/(n − 1); zero without repeats.
        """
        n = len(self.measured.repeats)
        if n < 2:
            return 0.0
        sd = self.measured.sd
        C = self.measured.covariance / np.outer(sd, sd)
        return float(np.sqrt((1.0 + np.trace(C) ** 2 / np.linalg.norm(C) ** 2) / (n - 1)))

    @property
    def agrees(self) -> bool:
        """True if the covariance of the samples differs from the measured one by no more than a tenth, and so the
        means."""
        near = bool((np.abs(self.mean_error) <= self._mean_limit).all())
        return near and self.covariance_error <= _TOLERATED_ERROR

    @property
    def _mean_limit(self) -> float:
        n = len(self.measured.repeats)
        return max(_TOLERATED_ERROR, _BEYOND_CHANCE / np.sqrt(n)) if n else _TOLERATED_ERROR

    @property
    def sentences(self) -> tuple[str, ...]:
        """The sentences of the check, the verdict first."""
        return (self._verdict, *self._of_means(), *self._of_spreads())

    @property
    def _verdict(self) -> str:
        if self.agrees:
            return (
                "The model with the updated parameters reproduces the measured means and covariance "
                f"(the covariances differ by {100 * self.covariance_error:.1f} %)."
            )
        return (
            "The model with the updated parameters does not reproduce the measured means and covariance (the "
            f"covariances differ by {100 * self.covariance_error:.0f} %). Other parameters may vary between the tests, "
            "or the differences may be measurement noise."
        )

    def _of_means(self) -> list[str]:
        size = np.abs(self.mean_error)
        far = [i for i in np.argsort(-size, kind="stable") if size[i] > self._mean_limit]
        labels, word = self.measured.labels, "measured standard deviations"
        side = ["above" if error > 0 else "below" for error in self.mean_error]
        if len(far) <= _LISTED:
            return [f"The mean of {labels[i]} is {size[i]:.2g} {word} {side[i]} the measured mean." for i in far]
        worst = ", ".join(f"{labels[i]} ({size[i]:.2g} {side[i]})" for i in far[:_LISTED])
        return [
            f"The means of {len(far)} of {len(size)} outputs differ from the measured means by more than "
            f"{self._mean_limit:.2g} {word}; the largest differences: {worst}."
        ]

    def _of_spreads(self) -> list[str]:
        n = len(self.measured.repeats)
        limit = max(_TOLERATED_ERROR, _BEYOND_CHANCE / np.sqrt(2.0 * (n - 1))) if n > 1 else _TOLERATED_ERROR
        labels, percent = self.measured.labels, 100.0 * self.sd_error
        # a standard deviation may be far too large or far too small
        order = np.argsort(-np.abs(np.log(np.maximum(1.0 + self.sd_error, 1e-12))), kind="stable")
        far = [i for i in order if abs(self.sd_error[i]) > limit]
        if len(far) <= _LISTED:
            return [
                f"The standard deviation of {labels[i]} differs from the measured one by {percent[i]:+.0f} %."
                for i in far
            ]
        worst = ", ".join(f"{labels[i]} ({percent[i]:+.0f} %)" for i in far[:_LISTED])
        return [
            f"The standard deviations of {len(far)} of {len(percent)} outputs differ from the measured ones by more "
            f"than {100.0 * limit:.0f} %; the largest differences: {worst}."
        ]


def forward_check(
    outputs: Outputs,
    result: StochasticResult,
    samples: int = 1000,
    seed: int = 1,
    solve: Callable[[Counted, Reals], Reals] = propagate,
) -> ForwardCheck:
    """Propagate a Latin hypercube of the updated distribution; its moments are exactly the updated ones.

    Parameters
    ----------
    solve : gives the outputs (n, m) of the samples (n, k); one after another by itself

    Raises
    ------
    FemtuneError : ``quantify.not-positive``, ``quantify.not-finite``, and what the model raises
    """
    counted = Counted(outputs)
    theta = latin_hypercube(result.mean, result.covariance, samples, seed)
    return ForwardCheck(result.names, theta, solve(counted, theta), result.measured, counted.solutions)


def ellipse(mean: Reals, covariance: Reals, probability: float = 0.95, points: int = 121) -> Reals:
    """(points, 2) closed curve that holds a share of a normal distribution of two values.

    95 % lie within 2.45 standard deviations; within two, which is often drawn, 86 %.

    Parameters
    ----------
    mean, covariance : (2,), (2, 2)
    """
    angle = np.linspace(0.0, 2.0 * np.pi, points)
    radius = np.sqrt(chdtri(2, 1.0 - probability))
    return np.asarray(mean + radius * np.column_stack([np.cos(angle), np.sin(angle)]) @ factor(covariance).T)
