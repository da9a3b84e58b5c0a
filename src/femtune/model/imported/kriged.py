"""Matrices of runs between the runs by Kriging: of principal components of their entries, or of single entries.

A(p) = Ā + Σ c_j(p) B_j with the mean Ā over the runs and a Kriging surrogate of each c_j, which has exact derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.parameters.jet import Jet
from femtune.surrogates import CORRELATIONS, KrigingRules, Surrogate, fit_surrogate
from femtune.surrogates.trend import TRENDS, exponents

_REST = 1e-13
"""Part of the squares of the changes between the runs that components left out may have."""
_MOST_COMPONENTS = 40


@dataclass(frozen=True, eq=False)
class Kriged:
    """Symmetric matrices of n runs between the runs.

    Parameters
    ----------
    mean : (r, r)
    parts : (q, r, r) matrices B that the components multiply
    surrogate : of the q components; None without any
    left_out : (n, r, r) matrix of each run as predicted from all others, at unchanged lengths
    """

    mean: Reals
    parts: Reals
    surrogate: Surrogate | None
    left_out: Reals


def kriged(names: tuple[str, ...], points: Reals, matrices: Reals, rules: KrigingRules, entries: bool) -> Kriged:
    """Fit to matrices (n, r, r) at points (n, k).

    Parameters
    ----------
    entries : the components are the entries that change, for diagonal matrices; otherwise principal components

    Raises
    ------
    FemtuneError : ``surrogate.*``
    """
    n, r, _ = matrices.shape
    mean = matrices.mean(axis=0)
    away = (matrices - mean).reshape(n, r * r)
    # what no run changes stays exactly as it is, such as the missing stiffness of rigid-body modes
    moving = np.flatnonzero(np.ptp(away, axis=0) > 0.0)
    if entries:
        parts = np.eye(r * r)[moving]
    else:
        _, size, rows = np.linalg.svd(away[:, moving], full_matrices=False)
        left = 1.0 - np.cumsum(size**2) / max(float(np.sum(size**2)), np.finfo(float).tiny)
        count = min(int(np.sum(left > _REST)) + 1, _MOST_COMPONENTS) if size.max(initial=0.0) > 0.0 else 0
        parts = np.zeros((count, r * r))
        parts[:, moving] = rows[:count]
    if not len(parts):
        return Kriged(mean, np.zeros((0, r, r)), None, np.broadcast_to(mean, matrices.shape))
    surrogate = fit_surrogate(points, away @ parts.T, rules, parameters=names)
    left_out = mean + (surrogate.left_out @ parts).reshape(n, r, r)
    return Kriged(mean, parts.reshape(-1, r, r), surrogate, left_out)


@dataclass(frozen=True, eq=False)
class KrigedCoefficient:
    """factor · (a response of a surrogate without logarithms), with first and second derivatives.

    Matérn 3/2 has no second derivative at the runs.
    """

    surrogate: Surrogate
    response: int

    def __call__(self, values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        s, fit = self.surrogate, self.surrogate.fits[self.response]
        width = s.upper - s.lower
        unit = [(values[name] - low) * (1.0 / w) for name, low, w in zip(s.parameters, s.lower, width, strict=True)]
        scaled: Jet = 0.0 * values["FACTOR"]
        for weight, term in zip(fit.trend, exponents(len(unit), TRENDS[s.rules.trend]), strict=True):
            product = values["FACTOR"] * 0.0 + float(weight)
            for parameter in term:
                product = product * unit[parameter]
            scaled = scaled + product
        runs = (s.x - s.lower) / width
        squared: Jet | None = None
        for u, place, length in zip(unit, runs.T, fit.lengths, strict=True):
            away = (u - place) * (1.0 / length)
            squared = away * away if squared is None else squared + away * away
        if squared is not None:
            kind = CORRELATIONS[s.rules.correlation]
            near = squared.chain(kind.value(squared.value), kind.slope(squared.value), kind.curvature(squared.value))
            scaled = scaled + _weighted_sum(near, fit.weights)
        return values["FACTOR"] * (scaled * float(s.scale[self.response]) + float(s.centre[self.response]))


def _weighted_sum(jets: Jet, weights: Reals) -> Jet:
    return Jet(
        np.sum(weights * jets.value, keepdims=True),
        np.sum(weights[:, None] * jets.grad, axis=0, keepdims=True),
        np.sum(weights[:, None, None] * jets.hess, axis=0, keepdims=True),
    )
