"""Polynomial trends of a surrogate, with their derivatives."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np

from femtune.arrays import Reals
from femtune.surrogates.kinds import TRENDS, Trend


def exponents(parameters: int, degree: int) -> list[tuple[int, ...]]:
    """Terms of a complete polynomial: the parameters whose product each is."""
    return [term for d in range(degree + 1) for term in combinations_with_replacement(range(parameters), d)]


def term_count(parameters: int, trend: Trend) -> int:
    """Number of coefficients of a trend."""
    return len(exponents(parameters, TRENDS[trend]))


def terms(x: Reals, trend: Trend) -> Reals:
    """(k, q) terms of the trend at points (k, n)."""
    columns = [np.prod(x[:, list(term)], axis=1) for term in exponents(x.shape[1], TRENDS[trend])]
    return np.stack(columns, axis=1)


def term_slopes(x: Reals, trend: Trend) -> Reals:
    """(k, q, n) derivatives of the terms."""
    every = exponents(x.shape[1], TRENDS[trend])
    slopes = np.zeros((len(x), len(every), x.shape[1]), dtype=x.dtype)
    for column, term in enumerate(every):
        for place, parameter in enumerate(term):
            rest = [*term[:place], *term[place + 1 :]]
            slopes[:, column, parameter] += np.prod(x[:, rest], axis=1)
    return slopes


def term_curvatures(x: Reals, trend: Trend) -> Reals:
    """(k, q, n, n) second derivatives of the terms; constant, as no term has more than two factors."""
    n = x.shape[1]
    every = exponents(n, TRENDS[trend])
    curvatures = np.zeros((len(every), n, n))
    for column, term in enumerate(every):
        if len(term) == 2:
            i, j = term
            curvatures[column, i, j] += 1.0
            curvatures[column, j, i] += 1.0
    return np.broadcast_to(curvatures, (len(x), *curvatures.shape))
