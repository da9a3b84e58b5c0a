"""Polynomial chaos: an expansion in products of Legendre polynomials, which are orthonormal over the box.

Of all products up to a degree, few are chosen for each response: always the one that reduces the squares the most
(orthogonal least squares), until the error of leaving out one run, corrected for the number of terms, does not fall any
more; the degree with the smallest such error is kept. The coefficients are those of ordinary least squares. Sobol's
indices for parameters that are uniform over the box follow from the coefficients without further evaluations.

Sources: Xiu and Karniadakis 2002; Chen, Cowan and Grant 1991 (orthogonal least squares); Blatman and Sudret 2011
(selection, corrected error); Sudret 2008 (indices).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import solve_triangular

from femtune.arrays import Integers, Reals
from femtune.experiments import VarianceIndices
from femtune.surrogates.surrogate import Surrogate

_MOST_CANDIDATES = 5000
"""Products of polynomials to choose from; a degree that has more is not tried, unless it is the first."""
_PATIENCE = 10
"""Terms that are added after the smallest error so far before the selection ends."""
_NEW = 1e-10
"""Part of a candidate that must be left beside the chosen ones."""


@dataclass(frozen=True)
class ChaosRules:
    """How polynomial chaos is fitted.

    Parameters
    ----------
    degree : largest total degree that is tried
    logarithms : fit the logarithms of the responses over those of the parameters, all of which must be positive
    """

    degree: int = 6
    logarithms: bool = False

    @property
    def label(self) -> str:
        """For messages."""
        return "polynomial chaos"

    def least_runs(self, parameters: int) -> int:
        """Those of a linear function, and two."""
        return parameters + 3

    def fits(self, u: Reals, y: Reals) -> tuple[ChaosResponse, ...]:
        """Of the responses (N, m) over scaled parameters (N, n)."""
        n = u.shape[1]
        degrees = [d for d in range(1, self.degree + 1) if d == 1 or comb(n + d, d) <= _MOST_CANDIDATES]
        every = _products(n, degrees[-1])
        total = every.sum(axis=1)
        values = _Product(every).value(u)
        return tuple(
            min(
                (_chosen(u, column, every[total <= d], values[:, total <= d]) for d in degrees),
                key=lambda fit: fit.corrected_error,
            )
            for column in y.T
        )


@dataclass(frozen=True, eq=False)
class ChaosResponse:
    """One response on scaled parameters and responses.

    Parameters
    ----------
    degrees : (t, n) degree of each polynomial in each term
    coefficients : (t,)
    factor : (t, t) upper triangular factor of the terms at the runs
    variance : σ² of what the terms do not explain
    errors, error_sd : (N,) errors of leaving out each run, and their standard deviations
    corrected_error : mean square of these errors, corrected for the number of terms
    """

    degrees: Integers
    coefficients: Reals
    factor: Reals
    variance: float
    errors: Reals
    error_sd: Reals
    corrected_error: float

    @property
    def freedom(self) -> int:
        """Runs less terms."""
        return len(self.errors) - len(self.coefficients)

    def value(self, u: Reals) -> Reals:
        """(k,) at points (k, n)."""
        return np.asarray(_Product(self.degrees).value(u) @ self.coefficients)

    def slopes(self, u: Reals) -> Reals:
        """(k, n) first derivatives."""
        product, n = _Product(self.degrees), u.shape[1]
        each = [product.value(u, tuple(np.eye(n, dtype=int)[i])) @ self.coefficients for i in range(n)]
        return np.stack(each, axis=1)

    def curvatures(self, u: Reals) -> Reals:
        """(k, n, n) second derivatives."""
        product, n = _Product(self.degrees), u.shape[1]
        found = np.empty((len(u), n, n), dtype=u.dtype)
        for i, j in combinations_with_replacement(range(n), 2):
            orders = tuple(np.eye(n, dtype=int)[i] + np.eye(n, dtype=int)[j])
            found[:, i, j] = found[:, j, i] = product.value(u, orders) @ self.coefficients
        return found

    def spread(self, u: Reals) -> Reals:
        """(k,) standard deviation of a run: what the terms do not explain, and that of the coefficients."""
        added = solve_triangular(self.factor, _Product(self.degrees).value(u).T, trans="T")
        return np.asarray(np.sqrt(self.variance * (1.0 + np.sum(added**2, axis=0))))

    def again(self, u: Reals, y: Reals) -> ChaosResponse:
        """Of other runs (N, n), (N,), with unchanged terms."""
        return _least_squares(y, self.degrees, _Product(self.degrees).value(u))


def chaos_indices(surrogate: Surrogate) -> VarianceIndices:
    """Sobol's indices of responses by polynomial chaos, for parameters that are uniform over the box.

    With `logarithms`, they are those of the logarithms of the responses, for logarithms of the parameters that are
    uniform. A response that does not vary has indices of zero.

    Examples
    --------
    >>> import numpy as np
    >>> from femtune.surrogates import ChaosRules, chaos_indices, fit_surrogate
    >>> x = np.random.default_rng(0).random((40, 2))
    >>> y = (x[:, 0] + 2.0 * x[:, 1])[:, None]
    >>> found = chaos_indices(fit_surrogate(x, y, ChaosRules(), box=(np.zeros(2), np.ones(2))))
    >>> found.first.round(6).tolist()
    [[0.2], [0.8]]
    """
    shares = [_shares(fit) for fit in surrogate.fits if isinstance(fit, ChaosResponse)]
    return VarianceIndices(*(np.stack(part, axis=1) for part in zip(*shares, strict=True)))


def explained_variances(surrogate: Surrogate) -> VarianceIndices:
    """Sobol's indices of all responses together, (n, 1): each weighted by its variance (Gamboa et al. 2014).

    Responses that are principal components with orthonormal directions have the indices of what they are components
    of.
    """
    variances = (
        np.array([_variance(fit) for fit in surrogate.fits if isinstance(fit, ChaosResponse)]) * surrogate.scale**2
    )
    each, whole = chaos_indices(surrogate), max(float(variances.sum()), np.finfo(float).tiny)
    return VarianceIndices(*((part @ variances / whole)[:, None] for part in (each.first, each.total)))


def term_counts(surrogate: Surrogate) -> tuple[int, ...]:
    """Number of terms of each response by polynomial chaos; of other surrogates none."""
    return tuple(len(fit.coefficients) for fit in surrogate.fits if isinstance(fit, ChaosResponse))


def _variance(fit: ChaosResponse) -> float:
    return float(np.sum(fit.coefficients[fit.degrees.any(axis=1)] ** 2))


def _shares(fit: ChaosResponse) -> tuple[Reals, Reals]:
    """(n,) first and total indices."""
    squares = fit.coefficients**2
    whole = max(_variance(fit), np.finfo(float).tiny)
    used = fit.degrees > 0
    alone = used & (used.sum(axis=1) == 1)[:, None]
    return squares @ alone / whole, squares @ used / whole


@dataclass(frozen=True, eq=False)
class _Product:
    """Products of Legendre polynomials with unit mean square over the unit cube; degrees (t, n)."""

    degrees: Integers

    def value(self, u: Reals, orders: tuple[int, ...] | None = None) -> Reals:
        """(k, t) products at points (k, n), or their partial derivatives of these orders."""
        highest = int(self.degrees.max(initial=0))
        found = np.ones((len(u), len(self.degrees)), dtype=u.dtype)
        for i, x in enumerate(u.T):
            found = found * _polynomials(x, highest, 0 if orders is None else int(orders[i]))[:, self.degrees[:, i]]
        return found


def _polynomials(x: Reals, highest: int, order: int) -> Reals:
    """(k, highest + 1) normalised polynomials, or a derivative of them, at (k,) in the unit interval."""
    every = np.diag(np.sqrt(2.0 * np.arange(highest + 1) + 1.0))
    if order > highest:
        return np.zeros((len(x), highest + 1), dtype=x.dtype)
    # of ξ = 2x − 1
    series = legendre.legder(every, order, scl=2.0) if order else every
    return np.asarray(legendre.legvander(2.0 * x - 1.0, len(series) - 1) @ series)


def _products(parameters: int, degree: int) -> Integers:
    """(t, n) degrees of all products up to a total degree, the constant first."""
    rows = []
    for d in range(degree + 1):
        for term in combinations_with_replacement(range(parameters), d):
            rows.append(np.bincount(np.array(term, dtype=int), minlength=parameters))
    return np.array(rows)


def _chosen(u: Reals, y: Reals, degrees: Integers, values: Reals) -> ChaosResponse:
    """The terms with the smallest corrected error, of those that orthogonal least squares adds one by one."""
    N = len(y)
    left, rest, full = values.copy(), y.copy(), np.sum(values**2, axis=0)
    chosen: list[int] = []
    leverage = np.zeros(N)
    best, best_count = np.inf, 1
    inverse = np.zeros((0, 0))
    basis = np.zeros((N, 0))
    while len(chosen) < min(N - 2, len(degrees)) and len(chosen) < best_count + _PATIENCE:
        size = np.sum(left**2, axis=0)
        usable = size > _NEW * full
        usable[chosen] = False
        if not usable.any():
            break
        gain = np.where(usable, (left.T @ rest) ** 2 / np.where(usable, size, 1.0), -1.0)
        # the mean belongs to every expansion
        k = int(np.argmax(gain)) if chosen else 0
        direction = left[:, k] / np.sqrt(size[k])
        along = basis.T @ values[:, k]
        inverse = _bordered(inverse, along, float(np.sqrt(size[k])))
        basis = np.column_stack([basis, direction])
        left -= np.outer(direction, direction @ left)
        rest = rest - direction * (direction @ rest)
        leverage += direction**2
        chosen.append(k)
        error = _corrected(rest / np.maximum(1.0 - leverage, 1e-12), inverse)
        if error < best:
            best, best_count = error, len(chosen)
    kept = chosen[:best_count]
    return _least_squares(y, degrees[kept], values[:, kept])


def _bordered(inverse: Reals, along: Reals, corner: float) -> Reals:
    """Inverse of an upper triangular matrix with one more column."""
    n = len(inverse)
    found = np.zeros((n + 1, n + 1))
    found[:n, :n] = inverse
    found[:n, n] = -(inverse @ along) / corner
    found[n, n] = 1.0 / corner
    return found


def _corrected(errors: Reals, inverse: Reals) -> float:
    """Mean square of errors of leaving out one run, times the factor of Blatman and Sudret for a choice of terms."""
    N, t = len(errors), len(inverse)
    return float(np.mean(errors**2) * N / (N - t) * (1.0 + np.sum(inverse**2)))


def _least_squares(y: Reals, degrees: Integers, values: Reals) -> ChaosResponse:
    """Coefficients of chosen terms, whose values at the runs are (N, t)."""
    basis, factor = np.linalg.qr(values)
    leverage = np.minimum(np.sum(basis**2, axis=1), 1.0 - 1e-12)
    coefficients = solve_triangular(factor, basis.T @ y)
    rest = y - values @ coefficients
    errors = rest / (1.0 - leverage)
    inverse = solve_triangular(factor, np.eye(len(factor)))
    # the terms were chosen by these runs: the residuals alone would give too small a variance
    variance = max(float(np.mean(errors**2 * (1.0 - leverage))), np.finfo(float).tiny)
    return ChaosResponse(
        degrees, coefficients, factor, variance, errors, np.sqrt(variance / (1.0 - leverage)),
        _corrected(errors, inverse),
    )  # fmt: skip
