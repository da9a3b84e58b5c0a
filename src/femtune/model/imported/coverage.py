"""Where a model of runs is supported by its runs: their ranges, and the deviation that surrogates state themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from femtune.arrays import Reals
from femtune.model.imported.fitted_matrices import FittedMatrices

_AT_THE_END = 1e-6
"""Part of the range by which a value may lie outside: bounds that are ends of the range are met up to rounding."""


@dataclass(frozen=True, eq=False)
class RunsCoverage:
    """The runs that a model was fitted to.

    Parameters
    ----------
    names : (k,) of the variables
    low, high : (k,) least and largest value of each in the runs
    stiffness, mass : surrogates of the modal matrices; None for polynomials, which state no deviation
    """

    names: tuple[str, ...]
    low: Reals
    high: Reals
    stiffness: FittedMatrices | None = None
    mass: FittedMatrices | None = None

    def outside(self, values: Mapping[str, float]) -> Iterator[tuple[str, float, float]]:
        """Variables outside the range of the runs, with the ends of the range.

        Examples
        --------
        >>> import numpy as np
        >>> from femtune.model.imported.coverage import RunsCoverage
        >>> list(RunsCoverage(("k",), np.array([500.0]), np.array([4000.0])).outside({"k": 150.0}))
        [('k', 500.0, 4000.0)]
        """
        for name, low, high in zip(self.names, self.low.tolist(), self.high.tolist(), strict=True):
            slack = _AT_THE_END * (high - low)
            if not low - slack <= values[name] <= high + slack:
                yield name, low, high

    def frequency_sd(self, values: Mapping[str, float]) -> Reals | None:
        """(m,) relative standard deviations of the frequencies by the surrogates; None for polynomials.

        With A(p) = Ā + Σ c_j B_j and independent components, var λ = Σ (φᵀB_jφ)² var c_j over the stiffness, and with λ
        times that over the mass; var f/f² = var λ/4λ². NaN for modes without stiffness.
        """
        if self.stiffness is None or self.mass is None:
            return None
        point = np.array([[values[name] for name in self.names]])
        stiffness, mass = self.stiffness.at(point), self.mass.at(point)
        try:
            eigenvalues, shapes = la.eigh(stiffness, mass)
        except la.LinAlgError:
            # far from the runs the mass is not positive any more
            return np.full(len(mass), np.inf)
        variance = _variance(self.stiffness, point, shapes) + eigenvalues**2 * _variance(self.mass, point, shapes)
        elastic = eigenvalues > 0.0
        return np.where(elastic, 0.5 * np.sqrt(variance) / np.where(elastic, eigenvalues, 1.0), np.nan)


def _variance(matrices: FittedMatrices, point: Reals, shapes: Reals) -> Reals:
    """(m,) variance of φᵀAφ."""
    if matrices.surrogate is None:
        return np.zeros(shapes.shape[1])
    effect = np.einsum("im,qij,jm->qm", shapes, matrices.parts, shapes)
    return np.asarray((matrices.surrogate.predict_sd(point)[0][:, None] ** 2 * effect**2).sum(axis=0))
