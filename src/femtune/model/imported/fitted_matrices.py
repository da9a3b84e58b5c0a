"""Matrices of runs between the runs by surrogates: of principal components of their entries, or of single entries.

A(p) = Ā + Σ c_j(p) B_j with the mean Ā over the runs and a surrogate of each c_j, which has exact derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.parameters.jet import Jet, constant
from femtune.surrogates import Surrogate, SurrogateRules, fit_surrogate

_NEGLECTED_VARIANCE = 1e-13
"""Part of the sum of squares of the changes between the runs that may be neglected: amplitudes below 3e-7."""
_MOST_COMPONENTS = 40
"""Principal components that get a surrogate at most: each takes the time of one fit."""


@dataclass(frozen=True, eq=False)
class FittedMatrices:
    """Symmetric matrices of n runs between the runs.

    Parameters
    ----------
    mean : (r, r)
    parts : (q, r, r) matrices B that the components multiply
    surrogate : of the q components; None without any
    left_out : (n, r, r) matrix of each run as predicted from all others, at unchanged hyperparameters
    """

    mean: Reals
    parts: Reals
    surrogate: Surrogate | None
    left_out: Reals

    def at(self, point: Reals) -> Reals:
        """(r, r) the matrix at a point (1, k)."""
        if self.surrogate is None:
            return self.mean
        return np.asarray(self.mean + np.tensordot(self.surrogate.predict(point)[0], self.parts, axes=1))


def fit_matrices(
    names: tuple[str, ...], points: Reals, matrices: Reals, rules: SurrogateRules, entries: bool
) -> FittedMatrices:
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
    # entries that no run changes stay exactly as they are, such as the missing stiffness of rigid-body modes
    moving = np.flatnonzero(np.ptp(away, axis=0) > 0.0)
    if entries:
        parts = np.eye(r * r)[moving]
    else:
        _, size, rows = np.linalg.svd(away[:, moving], full_matrices=False)
        left = 1.0 - np.cumsum(size**2) / max(float(np.sum(size**2)), np.finfo(float).tiny)
        count = min(int(np.sum(left > _NEGLECTED_VARIANCE)) + 1, _MOST_COMPONENTS) if size.max(initial=0.0) > 0.0 else 0
        parts = np.zeros((count, r * r))
        parts[:, moving] = rows[:count]
    if not len(parts):
        return FittedMatrices(mean, np.zeros((0, r, r)), None, np.broadcast_to(mean, matrices.shape))
    surrogate = fit_surrogate(points, away @ parts.T, rules, parameters=names)
    left_out = mean + (surrogate.left_out @ parts).reshape(n, r, r)
    return FittedMatrices(mean, parts.reshape(-1, r, r), surrogate, left_out)


@dataclass(frozen=True, eq=False)
class SurrogateCoefficient:
    """factor · (a response of a surrogate without logarithms), with first and second derivatives.

    Matérn 3/2 and thin plates have no second derivative at the runs.
    """

    surrogate: Surrogate
    response: int

    def __call__(self, values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        s, fit = self.surrogate, self.surrogate.fits[self.response]
        pairs = zip(s.parameters, s.lower, s.upper, strict=True)
        unit = [(values[name] - low) * (1.0 / (high - low)) for name, low, high in pairs]
        u = np.stack([one.value for one in unit], axis=-1)
        inner = np.stack([one.grad for one in unit], axis=-2)
        if not inner.shape[-1]:
            scaled = constant(fit.value(u), 0)
        else:
            slopes, curvatures = fit.slopes(u), fit.curvatures(u)
            bending = np.stack([one.bending for one in unit], axis=-2)
            scaled = Jet(
                fit.value(u),
                np.einsum("...n,...nk->...k", slopes, inner),
                np.einsum("...nm,...nk,...ml->...kl", curvatures, bending, bending)
                + np.einsum("...n,...nkl->...kl", slopes, np.stack([one.hess for one in unit], axis=-3)),
            )
        return values["FACTOR"] * (scaled * float(s.scale[self.response]) + float(s.centre[self.response]))
