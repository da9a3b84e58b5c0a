"""Polynomial surrogates of all residuals, from values and derivatives of the model at some points.

The residuals, not the likelihood, are modelled: sizes of the errors, priors and bounds then need no new solution. The
coordinates are logarithms of positive parameters, scaled to the region of the points. Value rows and derivative rows
are fitted together by weighted least squares.

Source: Y. M. Marzouk, D. Xiu, A stochastic collocation approach to Bayesian inference in inverse problems,
Communications in Computational Physics 6, 2009.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb

import numpy as np
import scipy.linalg as la

from femtune.arrays import Flags, Integers, Reals
from femtune.sampling.likelihood import Likelihood

_DERIVATIVE_WEIGHT = 0.5
"""Of a derivative row beside a value row: there are as many of them at a point as parameters."""
_VARIES = 0.02
"""Standard deviation over the samples, relative to the error, below which a combination of residuals is constant: a
hundred of them change the log likelihood by a tenth. The weights account for what is left out."""
_RANK = 1e-10
"""Singular value relative to the largest below which directions are the same."""
_CUT = 1e-10
"""Singular values relative to the largest below which coefficients are not determined by the points."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """Coordinates t = (f(P) − centre)/spread with P = nominal + scale·x and f = log where `log` is set.

    Parameters
    ----------
    nominal, scale, centre, spread : (k,)
    log : (k,) parameters of which the logarithm is the coordinate
    """

    nominal: Reals
    scale: Reals
    log: Flags
    centre: Reals
    spread: Reals

    @classmethod
    def identity(cls, k: int) -> Scaled:
        """t = x."""
        return cls(np.zeros(k), np.ones(k), np.zeros(k, bool), np.zeros(k), np.ones(k))

    def about(self, x: Reals) -> Scaled:
        """The same coordinates, centred and scaled to points (n, k)."""
        f = self._f(x)
        spread = f.std(axis=0)
        return Scaled(self.nominal, self.scale, self.log, f.mean(axis=0), np.where(spread > 0.0, spread, 1.0))

    def _f(self, x: Reals) -> Reals:
        P = self.nominal + self.scale * x
        return np.where(self.log, np.log(np.where(self.log, P, 1.0)), P)

    def of(self, x: Reals) -> Reals:
        """(n, k) t."""
        return np.asarray((self._f(x) - self.centre) / self.spread)

    def slope(self, x: Reals) -> Reals:
        """(n, k) ∂t/∂x."""
        P = self.nominal + self.scale * x
        return np.asarray(self.scale / np.where(self.log, P, 1.0) / self.spread)


@dataclass(frozen=True, eq=False)
class Monomials:
    """All monomials of k variables up to a degree, each the product of an earlier one and a variable.

    Examples
    --------
    >>> Monomials(2, 2).values(np.array([[2.0, 3.0]])).tolist()
    [[1.0, 2.0, 3.0, 4.0, 6.0, 9.0]]
    """

    k: int
    degree: int

    @staticmethod
    def number(k: int, degree: int) -> int:
        """How many there are."""
        return comb(k + degree, degree)

    @cached_property
    def _levels(self) -> tuple[tuple[Integers, Integers], ...]:
        """By degree from 1: positions of the earlier monomials, and the variables."""
        place: dict[tuple[int, ...], int] = {(): 0}
        levels = []
        for degree in range(1, self.degree + 1):
            words = list(combinations_with_replacement(range(self.k), degree))
            levels.append((np.array([place[w[:-1]] for w in words]), np.array([w[-1] for w in words])))
            place |= {w: len(place) + i for i, w in enumerate(words)}
        return tuple(levels)

    @cached_property
    def _sums(self) -> tuple[tuple[Reals, Reals, int, int], ...]:
        """By degree: 0-1 matrices that add up derivatives by earlier monomial and by variable; first and last place."""
        out, first = [], 1
        for parent, variable in self._levels:
            last = first + len(parent)
            to_parent, to_variable = np.zeros((len(parent), first)), np.zeros((len(parent), self.k))
            to_parent[np.arange(len(parent)), parent] = 1.0
            to_variable[np.arange(len(parent)), variable] = 1.0
            low = int(parent.min())
            out.append((np.ascontiguousarray(to_parent[:, low:]), to_variable, first, low))
            first = last
        return tuple(out)

    def values(self, t: Reals) -> Reals:
        """(n, q) at points (n, k)."""
        parts = [np.ones((len(t), 1))]
        for parent, variable in self._levels:
            parts.append(np.concatenate(parts, axis=1)[:, parent] * t[:, variable])
        return np.concatenate(parts, axis=1)

    def derivatives(self, t: Reals) -> Reals:
        """(n, k, q) by each variable."""
        values, out = self.values(t), np.zeros((len(t), self.k, self.number(self.k, self.degree)))
        for (parent, variable), (_, _, first, _) in zip(self._levels, self._sums):
            at = first + np.arange(len(parent))
            out[:, :, at] = out[:, :, parent] * t[:, None, variable]
            out[:, variable, at] += values[:, parent]
        return out

    def pulled_back(self, t: Reals, values: Reals, slope: Reals) -> Reals:
        """(n, k) gradient by t of a function with the gradient (n, q) by the monomials."""
        by_value, by_t = slope.copy(), np.zeros_like(t)
        for (parent, variable), (to_parent, to_variable, first, low) in zip(self._levels[::-1], self._sums[::-1]):
            columns = by_value[:, first : first + len(parent)]
            by_t += (columns * values[:, parent]) @ to_variable
            by_value[:, low : low + to_parent.shape[1]] += (columns * t[:, variable]) @ to_parent
        return by_t


@dataclass(frozen=True, eq=False)
class PolynomialResiduals:
    """Residuals (n,) as polynomials of x.

    Parameters
    ----------
    coefficients : (q, n)
    """

    scaled: Scaled
    monomials: Monomials
    coefficients: Reals

    def residuals(self, x: Reals) -> Reals:
        """(p, n) at points (p, k)."""
        return np.asarray(self.monomials.values(self.scaled.of(x)) @ self.coefficients)

    def for_chains(self, likelihood: Likelihood, x: Reals, sigma: Reals) -> ReducedSurrogate:
        """The same with few rows a group, for many evaluations.

        Parameters
        ----------
        x : (p, k) points over which combinations of residuals that hardly vary are taken as constant
        sigma : size of the errors of each group
        """
        residuals, by_group, B = self.residuals(x), [], []
        for group, size in zip(likelihood.groups, sigma):
            basis = _directions(residuals[:, group.rows], likelihood.B[group.rows], _VARIES * float(size))
            by_group.append(np.ascontiguousarray(self.coefficients[:, group.rows] @ basis))
            B.append(np.ascontiguousarray(basis.T @ likelihood.B[group.rows]))
        return ReducedSurrogate(self.scaled, self.monomials, tuple(by_group), tuple(B), likelihood)


def _directions(r: Reals, B: Reals, least: float) -> Reals:
    """(n, m) orthonormal directions: those in which residuals (p, n) vary by `least`, their mean, and the columns B."""
    mean = r.mean(axis=0)
    _, s, vt = la.svd(r - mean, full_matrices=False)
    kept = np.column_stack([vt[s / np.sqrt(len(r)) > least].T, mean, B])
    left, size, _ = la.svd(kept / np.maximum(np.linalg.norm(kept, axis=0), np.finfo(float).tiny), full_matrices=False)
    return np.asarray(left[:, size > _RANK * size[0]])


@dataclass(frozen=True, eq=False)
class ReducedSurrogate:
    """Log likelihood of a surrogate with its gradient."""

    scaled: Scaled
    monomials: Monomials
    coefficients: tuple[Reals, ...]
    B: tuple[Reals, ...]
    likelihood: Likelihood

    def log_likelihood(self, x: Reals, theta: Reals) -> tuple[Reals, Reals, Reals]:
        """(c,) log likelihood at points x (c, k) and sizes θ (c, t), with its gradients by both."""
        t = self.scaled.of(x)
        values = self.monomials.values(t)
        parts = tuple(values @ C for C in self.coefficients)
        log, by_parts, by_theta = self.likelihood.of(parts, self.B, theta)
        by_values = sum((g @ C.T for g, C in zip(by_parts, self.coefficients)), np.zeros_like(values))
        by_t = self.monomials.pulled_back(t, values, by_values)
        return log, by_t * self.scaled.slope(x), by_theta


def linear_surrogate(x: Reals, residuals: Reals, jacobian: Reals) -> PolynomialResiduals:
    """Residuals r + J (x' − x) about a point x (k,)."""
    k = len(x)
    coefficients = np.vstack([residuals - jacobian @ x, jacobian.T])
    return PolynomialResiduals(Scaled.identity(k), Monomials(k, 1), coefficients)


@dataclass(frozen=True, eq=False)
class Known:
    """The model at one point: residuals (n,), and their Jacobian (n, k) or None."""

    x: Reals
    residuals: Reals
    jacobian: Reals | None


def fit_surrogate(points: Sequence[Known], weights: Reals, scaled: Scaled, degree: int) -> PolynomialResiduals:
    """Polynomials through the residuals at some points.

    Parameters
    ----------
    weights : (p,) of the points
    scaled : coordinates
    """
    x = np.array([p.x for p in points])
    t, monomials = scaled.of(x), Monomials(x.shape[1], degree)
    rows, sides = [weights[:, None] * monomials.values(t)], [weights[:, None] * np.array([p.residuals for p in points])]
    sloped = [i for i, p in enumerate(points) if p.jacobian is not None]
    if sloped:
        w = _DERIVATIVE_WEIGHT * weights[sloped]
        derivatives = monomials.derivatives(t[sloped])
        jacobians = np.array([np.asarray(points[i].jacobian).T for i in sloped]) / scaled.slope(x[sloped])[:, :, None]
        rows.append((w[:, None, None] * derivatives).reshape(-1, derivatives.shape[2]))
        sides.append((w[:, None, None] * jacobians).reshape(-1, jacobians.shape[2]))
    coefficients = la.lstsq(np.concatenate(rows), np.concatenate(sides), cond=_CUT, lapack_driver="gelsd")[0]
    return PolynomialResiduals(scaled, monomials, np.asarray(coefficients))
