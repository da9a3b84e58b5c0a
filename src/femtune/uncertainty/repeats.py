"""Mean and covariance of outputs from repeated measurements, values that were not measured included.

Missing values are NaN. Their mean and covariance are those of the multivariate normal distribution that makes what
was measured most likely, found by expectation-maximisation (Dempster, Laird and Rubin 1977; Little and Rubin 2002,
section 11.2), or are estimated pair by pair from the repeats that have both values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.errors import FemtuneError, Notice
from femtune.uncertainty.kinds import CovarianceEstimate, MissingValues
from femtune.uncertainty.repeat_checks import RepeatChecks, check_repeats
from femtune.uncertainty.robust import RobustMoments, robust_moments

# ----------------------------------------------------------------------------------------------------
# Symmetric positive definite matrices: checks, factors, distances.


_LEAST_EIGENVALUE = -1e-8
"""Eigenvalue of a correlation matrix below which it is not rounding of zero."""


def check_positive(covariance: Reals, what: str, pairwise: bool = False) -> None:
    """Check a covariance: error if it is asymmetric, not finite, or its correlations have a negative eigenvalue.

    Raises
    ------
    FemtuneError : ``quantify.not-positive``
    """
    if np.isfinite(covariance).all() and np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0):
        lowest = least_eigenvalue(covariance)
        if lowest >= _LEAST_EIGENVALUE:
            return
        values = {"smallest eigenvalue of the correlation matrix": f"{lowest:.3g}"}
        code = "quantify.not-positive/pairwise" if pairwise else "quantify.not-positive"
        raise FemtuneError(code, values=values, covariance=what)
    raise FemtuneError("quantify.not-positive/not-symmetric", covariance=what)


def least_eigenvalue(covariance: Reals) -> float:
    """Least eigenvalue of the matrix scaled to a unit diagonal; negative where it is no covariance."""
    variance = np.diag(covariance)
    if (variance < 0.0).any():
        return -1.0
    sd = np.sqrt(np.where(variance > 0.0, variance, 1.0))
    return float(np.linalg.eigvalsh(covariance / np.outer(sd, sd)).min(initial=0.0 if not len(sd) else np.inf))


def factor(covariance: Reals) -> Reals:
    """L with L Lᵀ = covariance, for semidefinite matrices too; (k, k), Cholesky's where that exists."""
    try:
        return np.asarray(np.linalg.cholesky(covariance), dtype=float)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(covariance)
        return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def correlation_of(covariance: Reals) -> Reals:
    """(k, k) correlations; zero for outputs with zero variance."""
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(sd > 0.0, sd, 1.0)
    return np.asarray(covariance / np.outer(safe, safe))


def covariance_distance(reached: Reals, wanted: Reals) -> float:
    """|C − C₀|/|C₀| (Frobenius) after both are scaled by the wanted standard deviations."""
    sd = np.sqrt(np.diag(wanted))
    scale = np.outer(sd, sd)
    return float(np.linalg.norm((reached - wanted) / scale) / np.linalg.norm(wanted / scale))


_FEWEST_REPEATS = 2
"""Values without which there is no variance."""
_EM_STEPS = 2000
"""Steps of the EM algorithm at most; it converges linearly, and slowly where much is missing."""
_EM_TOLERANCE = 1e-10
"""Relative change of mean and covariance in a step that ends it, small because steps shrink slowly."""


@dataclass(frozen=True)
class OutputStatistics:
    """Mean and covariance of m measured outputs.

    Parameters
    ----------
    labels : (m,) names
    mean : (m,) in the unit of the outputs
    covariance : (m, m), of a single repeat and not of the mean
    repeats : (n, m) what was measured, NaN where it was not; no rows where only the moments are known
    estimate : how mean and covariance were found, in words
    notices : what the user should know about them
    checks : order dependence and outliers of the repeats; None if they were not checked
    robust : True if mean and covariance are robust, so that they are not those of the repeats
    scale : (m,) sizes to which deviations are relative; the magnitudes of the means where None
    noise : (m, m) covariance of the measurement errors of a single repeat; None for negligible ones
    """

    labels: tuple[str, ...]
    mean: Reals
    covariance: Reals
    repeats: Reals
    estimate: str
    notices: tuple[Notice, ...] = ()
    checks: RepeatChecks | None = None
    robust: bool = False
    noise: Reals | None = None
    scale: Reals | None = None

    @property
    def sizes(self) -> Reals:
        """(m,) sizes to which deviations are relative."""
        return np.abs(self.mean) if self.scale is None else self.scale

    @property
    def sd(self) -> Reals:
        """(m,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def complete(self) -> bool:
        """True if mean and covariance are those of the repeats, without missing values or measurement errors."""
        plain = self.noise is None and not self.robust
        return plain and len(self.repeats) > 0 and bool(np.isfinite(self.repeats).all())

    @property
    def structural(self) -> Reals:
        """(m, m) covariance without that of the measurement errors, chapter equation (38); may be indefinite."""
        return self.covariance if self.noise is None else self.covariance - self.noise

    @property
    def singular(self) -> bool:
        """True if there are too few repeats for an invertible covariance."""
        return bool(
            np.linalg.matrix_rank(self.covariance / np.outer(self.sd, self.sd), hermitian=True) < len(self.mean)
        )


def given_statistics(mean: Reals, covariance: Reals, labels: Sequence[str] = ()) -> OutputStatistics:
    """Mean (m,) and covariance (m, m) that are known without repeats.

    Raises
    ------
    FemtuneError : ``quantify.not-positive``, ``quantify.zero-variance``, ``quantify.size``
    """
    mean, covariance = np.asarray(mean, float), np.asarray(covariance, float)
    if covariance.shape != (len(mean), len(mean)):
        raise _sizes(mean, covariance)
    names = tuple(labels) or _numbered(len(mean))
    _check_variance(np.diag(covariance), mean, names)
    check_positive(covariance, "the covariance of the outputs")
    return OutputStatistics(names, mean, covariance, np.zeros((0, len(mean))), "given")


def statistics_of_repeats(
    repeats: Reals,
    labels: Sequence[str] = (),
    missing: MissingValues = "em",
    estimate: CovarianceEstimate = "sample",
    checked: bool = True,
) -> OutputStatistics:
    """Mean and covariance of repeats (n, m); NaN marks a value that was not measured.

    Parameters
    ----------
    missing : what is done with gaps. "em": maximum likelihood of the multivariate normal distribution, scaled by
        n/(n − 1); "pairwise": every entry from the repeats that have both values, which may give no positive definite
        matrix; "complete": repeats with gaps are left out
    estimate : "sample", or "robust": the reweighted minimum covariance determinant of the repeats without gaps, to
        which outliers do not contribute
    checked : True: test for dependence on the order, which is that of the rows, and for outliers

    Raises
    ------
    FemtuneError : ``quantify.too-few-repeats``, ``quantify.not-measured``, ``quantify.infinite``,
        ``quantify.zero-variance``, ``quantify.not-positive``, ``quantify.size``, ``quantify.robust``
    """  # fmt: skip
    table = np.atleast_2d(np.asarray(repeats, float))
    names = tuple(labels) or _numbered(table.shape[1])
    if len(names) != table.shape[1]:
        raise _sizes(np.zeros(len(names)), table)
    _check_finite(table, names)
    kept = table[np.isfinite(table).any(axis=1)]
    notices = _empty_rows(len(table) - len(kept))
    gaps = ~np.isfinite(kept)
    missing = "complete" if estimate == "robust" else missing
    if gaps.any() and missing == "complete":
        kept = kept[~gaps.any(axis=1)]
    _check_count(kept, names)
    mean, covariance, how = _robust(kept) if estimate == "robust" else _moments(kept, missing)
    _check_variance(np.diag(covariance), mean, names)
    check_positive(covariance, "the covariance of the repeats", missing == "pairwise")
    checks = check_repeats(table, names) if checked else None
    notices += _about_gaps(gaps, missing, how) + _about_count(kept) + (checks.notices if checks else ())
    return OutputStatistics(names, mean, covariance, kept, how, notices, checks, estimate == "robust")


def _robust(table: Reals) -> tuple[Reals, Reals, str]:
    moments = robust_moments(table)
    if isinstance(moments, RobustMoments):
        return moments.mean, moments.covariance, "minimum covariance determinant, reweighted"
    sizes = {"repeats without missing values": len(table), "outputs": table.shape[1]}
    if moments == "flat":
        raise FemtuneError("quantify.robust/flat", values=sizes)
    raise FemtuneError("quantify.robust", values=sizes)


def _moments(table: Reals, missing: MissingValues) -> tuple[Reals, Reals, str]:
    if np.isfinite(table).all():
        return table.mean(axis=0), np.atleast_2d(np.cov(table.T)), "sample mean and covariance"
    if missing == "pairwise":
        return np.nanmean(table, axis=0), _pairwise(table), "pair by pair, from the repeats that have both values"
    return *expectation_maximisation(table), "maximum likelihood of a normal distribution (EM) with the gaps"


def _pairwise(table: Reals) -> Reals:
    known = np.isfinite(table)
    both = known.T.astype(float) @ known
    _check_pairs(both)
    value = np.where(known, table, 0.0)
    # means over the repeats that have both, as the entry of two columns without gaps would be
    sums = value.T @ known
    products = value.T @ value - sums * sums.T / both
    return np.asarray(products / (both - 1.0))


def _check_pairs(both: Reals) -> None:
    if both.min() < _FEWEST_REPEATS:
        i, j = np.unravel_index(int(both.argmin()), both.shape)
        raise FemtuneError("quantify.too-few-repeats", first=i + 1, second=j + 1, repeats=both.min())


def expectation_maximisation(table: Reals) -> tuple[Reals, Reals]:
    """Maximum-likelihood mean (m,) and covariance (m, m) of a table (n, m) with missing values; covariance times n/(n −
    1).

    Source: Little and Rubin (2002), Statistical Analysis with Missing Data, section 11.2.
    """
    n = len(table)
    mean = np.nanmean(table, axis=0)
    spread = np.diag(np.nanvar(table, axis=0))
    scale = np.sqrt(np.maximum(np.diag(spread), np.finfo(float).tiny))
    for _ in range(_EM_STEPS):
        filled, extra = _expected(table, mean, spread)
        new_mean = filled.mean(axis=0)
        centred = filled - new_mean
        new = (centred.T @ centred + extra) / n
        moved = max(_largest((new_mean - mean) / scale), _largest((new - spread) / np.outer(scale, scale)))
        mean, spread = new_mean, new
        if moved < _EM_TOLERANCE:
            break
    return mean, spread * n / (n - 1.0)


def _largest(a: Reals) -> float:
    return float(np.abs(a).max())


def _expected(table: Reals, mean: Reals, covariance: Reals) -> tuple[Reals, Reals]:
    """The table with missing values replaced by their conditional means, and the sum of the conditional covariances."""
    filled, extra = table.copy(), np.zeros_like(covariance)
    for row in filled:
        gap = np.flatnonzero(np.isnan(row))
        if not len(gap):
            continue
        known = np.flatnonzero(~np.isnan(row))
        cross = covariance[np.ix_(gap, known)]
        slope = cross @ np.linalg.pinv(covariance[np.ix_(known, known)], hermitian=True)
        row[gap] = mean[gap] + slope @ (row[known] - mean[known])
        extra[np.ix_(gap, gap)] += covariance[np.ix_(gap, gap)] - slope @ cross.T
    return filled, extra


def _numbered(m: int) -> tuple[str, ...]:
    return tuple(f"output {i + 1}" for i in range(m))


def _check_finite(table: Reals, names: tuple[str, ...]) -> None:
    if np.isinf(table).any():
        row, column = np.argwhere(np.isinf(table))[0]
        raise FemtuneError("quantify.infinite", repeat=row + 1, output=names[column])
    for i, name in enumerate(names):
        if np.isfinite(table[:, i]).sum() < _FEWEST_REPEATS:
            raise FemtuneError(
                "quantify.not-measured",
                values={"repeats with a value": int(np.isfinite(table[:, i]).sum()), "repeats": len(table)},
                output=name,
            )


def _check_count(table: Reals, names: tuple[str, ...]) -> None:
    if len(table) < _FEWEST_REPEATS:
        raise FemtuneError("quantify.too-few-repeats/one", values={"repeats": len(table), "outputs": len(names)})


def _check_variance(variance: Reals, mean: Reals, names: tuple[str, ...]) -> None:
    flat = variance <= (1e-12 * np.abs(mean)) ** 2
    if flat.any():
        raise FemtuneError(
            "quantify.zero-variance",
            values={"outputs with zero variance": ", ".join(n for n, f in zip(names, flat) if f)},
            output=names[int(np.argmax(flat))],
        )


def _sizes(mean: Reals, table: Reals) -> FemtuneError:
    return FemtuneError(
        "quantify.size", values={"names or means": len(mean), "table": f"{table.shape[0]} × {table.shape[1]}"}
    )


def _empty_rows(count: int) -> tuple[Notice, ...]:
    code = "quantify.missing-values/empty-repeats" if count > 1 else "quantify.missing-values/empty-repeat"
    return (Notice(code, count=count),) if count else ()


def _about_gaps(gaps: NDArray[np.bool_], missing: MissingValues, estimate: str) -> tuple[Notice, ...]:
    if not gaps.any():
        return ()
    if missing == "complete":
        left_out = int(gaps.any(axis=1).sum())
        return (
            Notice("quantify.missing-values/complete", missing=int(gaps.sum()), total=gaps.size, left_out=left_out),
        )
    return (Notice("quantify.missing-values", missing=int(gaps.sum()), total=gaps.size, estimate=estimate),)


def _about_count(table: Reals) -> tuple[Notice, ...]:
    n, m = table.shape
    if n > m:
        return ()
    return (Notice("quantify.singular", repeats=n, outputs=m),)
