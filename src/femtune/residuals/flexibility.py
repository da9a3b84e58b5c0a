"""Modal flexibility: Σ ψψᵀ/ω² of the paired modes at the sensors, of mass-normalised test shapes.

Source: Pandey and Biswas (1994). The lowest modes contribute most, so that few of them are sufficient.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.residuals.asked import Asked, check_asked_mass_scaled
from femtune.residuals.case import PairedMode
from femtune.residuals.pair import OfPairs
from femtune.residuals.shape import check_mass_scaled
from femtune.residuals.weights import ResidualBlock, Weights


@dataclass(frozen=True)
class FlexibilityResidual(OfPairs):
    """Differences of modal flexibilities, each of the same paired modes.

    Parameters
    ----------
    sd : of an entry, relative to the largest entry of the test's flexibility
    part : "matrix" for the upper triangle, "diagonal" for it alone
    """

    sd: float
    part: str = "matrix"
    key = "flexibility"
    label = "flexibility"
    not_normal = "its entries are products of a few shapes, so that their errors are not independent"

    @classmethod
    def of_study(cls, asked: Asked) -> FlexibilityResidual:
        """See `Residual` (error ``residual.not-mass-scaled``)."""
        check_asked_mass_scaled(asked)
        return cls(asked.entry.sd, asked.entry.part)

    def __post_init__(self) -> None:
        Weights(self.sd)

    def of_pairs(self, pairs: Sequence[PairedMode]) -> Sequence[ResidualBlock]:
        """One block a configuration; entries of sensors that one of the modes lacks are left out.

        Raises
        ------
        FemtuneError : ``residual.not-mass-scaled``
        """
        if not pairs:
            return []
        check_mass_scaled(pairs[0])
        known = np.flatnonzero(~np.isnan([p.test_shape for p in pairs]).any(axis=0))
        rows, columns = self._entries(len(known))
        test = sum(_outer(p.test_shape[known]) / (2.0 * np.pi * p.test_hz) ** 2 for p in pairs)
        model = sum(_outer(p.shape[known]) / p.eigenvalue for p in pairs)
        slopes = np.sum([_slope(p, known) for p in pairs], axis=0)
        size = float(np.abs(test).max(initial=0.0)) or 1.0
        label = ", ".join(p.label for p in pairs)
        errors = np.asarray(model - test)[rows, columns] / size
        weights = Weights(self.sd)
        return [self.weighted(pairs[0].case.name, label, errors, slopes[rows, columns] / size, weights)]

    def _entries(self, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return (np.arange(n), np.arange(n)) if self.part == "diagonal" else np.triu_indices(n)


def _outer(shape: Reals) -> Reals:
    return np.outer(shape, shape)


def _slope(pair: PairedMode, known: NDArray[np.int64]) -> Reals:
    """(s, s, k) derivative of φφᵀ/λ."""
    phi, slope = pair.shape[known], pair.shape_gradient[known]
    half = phi[:, None, None] * slope[None, :, :]
    change = half + np.swapaxes(half, 0, 1)
    return np.asarray((change - _outer(phi)[:, :, None] * pair.eigenvalue_gradient / pair.eigenvalue) / pair.eigenvalue)
