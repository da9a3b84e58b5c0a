"""Polynomial chaos: an expansion in products of Legendre polynomials, which are orthonormal over the box.

Of all products up to a degree, few are chosen for each response: always the one that reduces the squares the most
(orthogonal least squares), until the error of leaving out one run, corrected for the number of terms, does not fall any
more; the degree with the smallest such error is kept. The coefficients are those of ordinary least squares. As this
error is too small where the candidates are many, the errors that are stated are those of cross-validation, in which
the terms are chosen again without each tenth of the runs. Sobol's indices for parameters that are uniform over the box
follow from the coefficients without further evaluations.

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
_MOST_TERMS = 2.0 / 3.0
"""Largest number of terms, as a part of the runs; with more of them the leave-one-out error has no meaning."""
_NEW = 1e-10
"""Part of a candidate that must be left beside the chosen ones."""
_FOLDS = 10
"""Parts of the runs that are left out, one after the other, to find the error of a prediction."""
_LEAST = 1e-12
"""Smallest value of one minus the leverage of a run, by which residuals are divided."""


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
        """Name in messages."""
        return "polynomial chaos"

    def least_runs(self, parameters: int) -> int:
        """Those of a linear function, and two."""
        return parameters + 3

    def fits(self, u: Reals, y: Reals) -> tuple[ChaosResponse, ...]:
        """Fits of the responses (N, m) over scaled parameters (N, n)."""
        n = u.shape[1]
        highest = max(d for d in range(1, self.degree + 1) if d == 1 or comb(n + d, d) <= _MOST_CANDIDATES)
        every = products_up_to(n, highest)
        values = LegendreProducts(every).value(u)
        return tuple(_fitted(column, every, values) for column in y.T)


@dataclass(frozen=True, eq=False)
class ChaosResponse:
    """One response on scaled parameters and responses.

    Parameters
    ----------
    degrees : (t, n) degree of each polynomial in each term
    coefficients : (t,)
    factor : (t, t) upper triangular factor of the terms at the runs
    variance : σ² of what the terms do not explain, by cross-validation
    errors, error_sd : (N,) errors of each run as predicted from the other folds, and their standard deviations
    """

    degrees: Integers
    coefficients: Reals
    factor: Reals
    variance: float
    errors: Reals
    error_sd: Reals

    @property
    def freedom(self) -> int:
        """Runs less terms."""
        return len(self.errors) - len(self.coefficients)

    def value(self, u: Reals) -> Reals:
        """(k,) at points (k, n)."""
        return np.asarray(LegendreProducts(self.degrees).value(u) @ self.coefficients)

    def slopes(self, u: Reals) -> Reals:
        """(k, n) first derivatives."""
        product, n = LegendreProducts(self.degrees), u.shape[1]
        each = [product.value(u, tuple(np.eye(n, dtype=int)[i])) @ self.coefficients for i in range(n)]
        return np.stack(each, axis=1)

    def curvatures(self, u: Reals) -> Reals:
        """(k, n, n) second derivatives."""
        product, n = LegendreProducts(self.degrees), u.shape[1]
        curvatures = np.empty((len(u), n, n), dtype=u.dtype)
        for i, j in combinations_with_replacement(range(n), 2):
            orders = tuple(np.eye(n, dtype=int)[i] + np.eye(n, dtype=int)[j])
            curvatures[:, i, j] = curvatures[:, j, i] = product.value(u, orders) @ self.coefficients
        return curvatures

    def spread(self, u: Reals) -> Reals:
        """(k,) standard deviation of a run: what the terms do not explain, and that of the coefficients."""
        return np.asarray(np.sqrt(self.variance * (1.0 + _added(self.factor, LegendreProducts(self.degrees).value(u)))))

    def again(self, u: Reals, y: Reals) -> ChaosResponse:
        """The fit to other runs (N, n), (N,), with unchanged terms and variance; errors are leave-one-out errors."""
        values = LegendreProducts(self.degrees).value(u)
        coefficients, factor = _least_squares(y, values)
        kept = np.maximum(1.0 - _added(factor, values), _LEAST)
        errors = (y - values @ coefficients) / kept
        return ChaosResponse(self.degrees, coefficients, factor, self.variance, errors, np.sqrt(self.variance / kept))


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
class LegendreProducts:
    """Products of Legendre polynomials with unit mean square over the unit cube; degrees (t, n)."""

    degrees: Integers

    def value(self, u: Reals, orders: tuple[int, ...] | None = None) -> Reals:
        """(k, t) products at points (k, n), or their partial derivatives of these orders."""
        highest = int(self.degrees.max(initial=0))
        product = np.ones((len(u), len(self.degrees)), dtype=u.dtype)
        for i, x in enumerate(u.T):
            product = product * _polynomials(x, highest, 0 if orders is None else int(orders[i]))[:, self.degrees[:, i]]
        return product


def _polynomials(x: Reals, highest: int, order: int) -> Reals:
    """(k, highest + 1) normalised polynomials, or a derivative of them, at (k,) in the unit interval."""
    every = np.diag(np.sqrt(2.0 * np.arange(highest + 1) + 1.0))
    if order > highest:
        return np.zeros((len(x), highest + 1), dtype=x.dtype)
    # of ξ = 2x − 1
    series = legendre.legder(every, order, scl=2.0) if order else every
    return np.asarray(legendre.legvander(2.0 * x - 1.0, len(series) - 1) @ series)


def products_up_to(parameters: int, degree: int) -> Integers:
    """(t, n) degrees of all products up to a total degree, the constant first."""
    rows = []
    for d in range(degree + 1):
        for term in combinations_with_replacement(range(parameters), d):
            rows.append(np.bincount(np.array(term, dtype=int), minlength=parameters))
    return np.array(rows)


def _fitted(y: Reals, degrees: Integers, values: Reals) -> ChaosResponse:
    """The chosen terms, and errors by cross-validation, in which the terms are chosen again without each fold."""
    totals = degrees.sum(axis=1)
    errors, added = np.empty(len(y)), np.empty(len(y))
    for left_out in folds(len(y)):
        kept = np.setdiff1d(np.arange(len(y)), left_out)
        terms = _chosen(y[kept], totals, values[kept])
        coefficients, factor = _least_squares(y[kept], values[kept][:, terms])
        there = values[left_out][:, terms]
        errors[left_out] = y[left_out] - there @ coefficients
        added[left_out] = _added(factor, there)
    variance = max(float(np.mean(errors**2 / (1.0 + added))), np.finfo(float).tiny)
    terms = _chosen(y, totals, values)
    coefficients, factor = _least_squares(y, values[:, terms])
    return ChaosResponse(degrees[terms], coefficients, factor, variance, errors, np.sqrt(variance * (1.0 + added)))


def folds(runs: int) -> list[Integers]:
    """Numbers of the runs that are left out together; at random, as the order of the runs may be that of a grid."""
    return np.array_split(np.random.default_rng(0).permutation(runs), min(_FOLDS, runs))


def _chosen(y: Reals, totals: Integers, values: Reals) -> list[int]:
    """The terms with the smallest corrected error, over the largest total degrees; candidates are sorted by degree."""
    candidates = np.ascontiguousarray(values.T)
    counts = np.searchsorted(totals, np.arange(1, totals[-1] + 1), side="right")
    most = min(len(y) - 2, max(int(counts[0]), int(_MOST_TERMS * len(y))))
    return min((_selection(y, candidates[:count], most) for count in counts), key=lambda found: found[0])[1]


def _selection(y: Reals, candidates: Reals, most: int) -> tuple[float, list[int]]:
    """Smallest corrected error, and the terms that have it, of candidates (t, N) of which `most` are added one by one.

    What is left of a candidate beside the chosen ones is known by its squares and its product with the residuals.
    """
    most = min(most, len(candidates))
    full = np.sum(candidates**2, axis=1)
    size, product, rest = full.copy(), candidates @ y, y
    basis, inverse, leverage = np.zeros((most, len(y))), np.zeros((most, most)), np.zeros(len(y))
    trace, best, best_count = 0.0, np.inf, 1
    chosen: list[int] = []
    usable = np.ones(len(candidates), dtype=bool)
    while len(chosen) < min(most, best_count + _PATIENCE):
        t = len(chosen)
        usable &= size > _NEW * full
        if not usable.any():
            break
        # the mean belongs to every expansion
        k = int(np.argmax(np.where(usable, product**2 / np.where(usable, size, 1.0), -1.0))) if t else 0
        along, direction = _orthogonal(candidates[k], basis[:t])
        corner = float(np.linalg.norm(direction))
        basis[t] = direction = direction / corner
        # the inverse of the triangular factor
        inverse[:t, t], inverse[t, t] = -(inverse[:t, :t] @ along) / corner, 1.0 / corner
        trace += float(np.sum(inverse[: t + 1, t] ** 2))
        row, amount = candidates @ direction, float(direction @ rest)
        size, product = size - row**2, product - amount * row
        rest, leverage = rest - amount * direction, leverage + direction**2
        usable[k] = False
        chosen.append(k)
        error = _corrected(rest / np.maximum(1.0 - leverage, _LEAST), t + 1, trace)
        if error < best:
            best, best_count = error, t + 1
    return best, chosen[:best_count]


def _orthogonal(x: Reals, basis: Reals) -> tuple[Reals, Reals]:
    """Parts of x (N,) along a basis (t, N), and what is left; twice, as rounding leaves parts of the first."""
    along = basis @ x
    left = x - along @ basis
    again = basis @ left
    return along + again, left - again @ basis


def _corrected(errors: Reals, terms: int, trace: float) -> float:
    """Mean square of errors of leaving out one run, times the factor of Blatman and Sudret for a choice of terms."""
    return float(np.mean(errors**2)) * len(errors) / (len(errors) - terms) * (1.0 + trace)


def _least_squares(y: Reals, values: Reals) -> tuple[Reals, Reals]:
    """Coefficients of terms whose values at the runs are (N, t), and the triangular factor of the values."""
    basis, factor = np.linalg.qr(values)
    return solve_triangular(factor, basis.T @ y), factor


def _added(factor: Reals, values: Reals) -> Reals:
    """(k,) variance of predictions at terms (k, t) by that of the coefficients, in units of σ²."""
    return np.asarray(np.sum(solve_triangular(factor, values.T, trans="T") ** 2, axis=0))
