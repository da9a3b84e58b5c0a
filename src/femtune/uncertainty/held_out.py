"""Is the predicted distribution that of repeats that were not used? Means and covariance, with a parametric bootstrap.

The update is fitted to some repeats. Mean and covariance that the updated model predicts are compared with those of the
other repeats, in a metric in which predicted outputs are uncorrelated and have unit variance. The p-values take into
account that the distribution was itself estimated: repeats for fit and check are drawn from the predicted distribution,
the update is repeated to first order, and both differences are computed as with the measured repeats. The smaller
p-value is corrected for being the smaller of two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from femtune.arrays import Flags, Reals
from femtune.errors import FemtuneError
from femtune.uncertainty.order_tests import corrected
from femtune.uncertainty.repeats import factor

LEVEL = 0.05
"""Significance level."""
FEWEST = 5
"""Repeats without gaps for a comparison; fewer would not reject any but gross differences."""
_BOOTSTRAP_DRAWS = 999
"""Draws of a parametric bootstrap: with the data themselves they make p-values multiples of 0.001."""
_STILL = 1e-6
"""Predicted standard deviations below this part of the measured one are rounding."""

Part = Literal["means", "covariance"]


@dataclass(frozen=True)
class HeldOutCheck:
    """Comparison of a predicted distribution with repeats that were not used.

    Parameters
    ----------
    repeats : number of repeats that were compared, those without missing values
    p_values : of the difference of the means and of the covariances, each corrected for two tests
    mean_difference : (m,) mean of these repeats − predicted mean, in predicted standard deviations; NaN for outputs
        that were not compared
    sd_ratio : (m,) their standard deviations by the predicted ones; likewise
    silent : (m,) True for outputs that were to be compared, and whose prediction has no variation
    """

    repeats: int
    p_values: dict[Part, float]
    mean_difference: Reals
    sd_ratio: Reals
    silent: Flags

    @property
    def p_value(self) -> float:
        """Probability that repeats of the predicted distribution have as small a p-value in either test."""
        return min(self.p_values.values())

    @property
    def agrees(self) -> bool:
        """True unless a difference is significant at 5 %."""
        return self.p_value > LEVEL


def held_out_repeats(count: int, held: float | tuple[int, ...], seed: int) -> Flags:
    """(count,) True for the repeats that are held out: a random fraction, or those with these numbers (from 1).

    Raises
    ------
    FemtuneError : ``quantify.hold-out`` for a number that no repeat has, and where fewer than two repeats remain

    Examples
    --------
    >>> from femtune.uncertainty.held_out import held_out_repeats
    >>> held_out_repeats(5, (2, 5), seed=1).tolist()
    [False, True, False, False, True]
    """
    out = np.zeros(count, dtype=bool)
    if isinstance(held, tuple):
        wrong = [i for i in held if not 1 <= i <= count]
        if wrong:
            raise FemtuneError("quantify.hold-out", values={"repeats": count}, number=wrong[0])
        out[np.array(held, dtype=np.int64) - 1] = True
    else:
        out[np.random.default_rng(seed).permutation(count)[: round(held * count)]] = True
    if not out.any() or count - out.sum() < 2:
        raise FemtuneError("quantify.hold-out/all", values={"repeats": count, "held out": int(out.sum())})
    return out


@dataclass(frozen=True)
class Fit:
    """Data of a first-order repetition of the update.

    Parameters
    ----------
    repeats : number of repeats of the fit
    mean, covariance : (m,), (m, m) predicted for single repeats
    projection : (m, m) G T, by which changes of measured outputs change predicted ones
    noise : (m, m) measurement covariance that the update has subtracted, zero for none
    compared : (m,) True for the outputs that are compared; None for all
    """

    repeats: int
    mean: Reals
    covariance: Reals
    projection: Reals
    noise: Reals
    compared: Flags | None = None


def check_held_out(held: Reals, fit: Fit, seed: int = 0) -> HeldOutCheck | None:
    """Compare held-out repeats (n, m) with the prediction of a fit.

    None for fewer than five repeats without missing values, and if the prediction has no variation of any output: a
    parameter that does not change an output predicts no standard deviation to measure a difference by.

    Source: Efron and Tibshirani (1993), An Introduction to the Bootstrap, chapter 16; Westfall and Young (1993) for the
    correction.
    """
    asked = np.ones(len(fit.mean), dtype=bool) if fit.compared is None else fit.compared
    held = held[np.isfinite(held[:, asked]).all(axis=1)]
    if len(held) < FEWEST:
        return None
    sd, spread = np.sqrt(np.diag(fit.covariance)), held.std(axis=0, ddof=1)
    used = asked & (sd > _STILL * np.nan_to_num(spread)) & (sd > 0.0)
    if not used.any():
        return None
    measured = differences(held[:, used], fit.mean[used], fit.covariance[np.ix_(used, used)], fit.repeats)
    rng, root = np.random.default_rng(seed), factor(fit.covariance)
    by_chance = [_repeated(fit, root, used, len(held), rng) for _ in range(_BOOTSTRAP_DRAWS)]
    parts: tuple[Part, ...] = ("means", "covariance")
    p = dict(zip(parts, corrected(np.array([measured, *by_chance]).T)))
    sd = np.where(used, sd, np.nan)
    return HeldOutCheck(len(held), p, (held.mean(axis=0) - fit.mean) / sd, spread / sd, asked & ~used)


def _repeated(fit: Fit, root: Reals, used: Flags, count: int, rng: np.random.Generator) -> tuple[float, float]:
    """The differences of repeats for fit and check that are drawn from the predicted distribution."""
    drawn = fit.mean + rng.standard_normal((fit.repeats + count, len(fit.mean))) @ root.T
    fitted, held = drawn[: fit.repeats], drawn[fit.repeats :]
    mean = fit.mean + fit.projection @ (fitted.mean(axis=0) - fit.mean)
    covariance = fit.projection @ (np.atleast_2d(np.cov(fitted.T)) - fit.noise) @ fit.projection.T + fit.noise
    return differences(held[:, used], mean[used], covariance[np.ix_(used, used)], fit.repeats)


def differences(held: Reals, mean: Reals, covariance: Reals, repeats: int) -> tuple[float, float]:
    """Lengths of the differences of means and of covariances, in the metric of the prediction."""
    white = whitening(covariance, repeats)
    gap = np.atleast_2d(np.cov(held.T)) - covariance
    return float(np.linalg.norm((held.mean(axis=0) - mean) @ white)), float(np.linalg.norm(white.T @ gap @ white))


def whitening(covariance: Reals, repeats: int) -> Reals:
    """(m, m) W with Wᵀ C W = 1, the correlations shrunk to zero by outputs/repeats."""
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    share = min(1.0, len(sd) / repeats)
    correlation = (1.0 - share) * covariance / np.outer(sd, sd) + share * np.eye(len(sd))
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(vectors / np.sqrt(values) / sd[:, None])
