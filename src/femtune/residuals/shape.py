"""Mode-shape residuals: the difference of shapes that are scaled alike, or the MAC."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.residuals.block import ResidualBlock
from femtune.residuals.pair import PairedMode, PairResidual

Reals = NDArray[np.float64]
Scaling = Literal["unit-norm", "largest-entry"]


def shape_difference(
    shape: Reals, gradient: Reals, test: Reals, sd: float, scaling: str = "unit-norm"
) -> tuple[Reals, Reals]:
    """(φ − φ_e)/σ over the measured entries, signs aligned; both shapes scaled in the same way.

    Parameters
    ----------
    shape, gradient : (s,) and (s, k) model shape at the sensors, in any scale
    test : (s,) test shape; NaN entries are left out
    scaling : "unit-norm" (both of unit Euclidean norm; the norm of the difference is √(2(1 − √MAC))) or
        "largest-entry" (entry where the test is largest scaled to one in both, that entry left out)
    """
    known = ~np.isnan(test)
    phi, slope, reference = shape[known], gradient[known], test[known]
    scaled = _unit_norm if scaling == "unit-norm" else _largest_entry
    values, jacobian = scaled(phi, slope, reference)
    return values / sd, jacobian / sd


def _unit_norm(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    norm = np.sign(phi @ test or 1.0) * np.linalg.norm(phi)
    unit = phi / norm
    return unit - test / np.linalg.norm(test), (slope - np.outer(unit, unit @ slope)) / norm


def _largest_entry(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    top = int(np.argmax(np.abs(test)))
    rest = np.arange(len(test)) != top
    ratio = phi / phi[top]
    jacobian = (slope - np.outer(ratio, slope[top])) / phi[top]
    return (ratio - test / test[top])[rest], jacobian[rest]


def mac_residual(shape: Reals, gradient: Reals, test: Reals, sd: float) -> tuple[Reals, Reals]:
    """(1 − √MAC)/√MAC /σ, (1,) and (1, k): zero where the shapes are parallel."""
    known = ~np.isnan(test)
    phi, slope, reference = shape[known], gradient[known], test[known] / np.linalg.norm(test[known])
    inner = float(phi @ reference)
    side = np.sign(inner) or 1.0
    norm = np.linalg.norm(phi)
    root = side * inner / norm
    d_root = side * (reference @ slope) / norm - root * (phi @ slope) / norm**2
    return np.array([(1.0 - root) / root / sd]), (-d_root / root**2 / sd)[None, :]


@dataclass(frozen=True)
class ShapeResidual(PairResidual):
    """Differences of shapes that are scaled alike; `sd` is of an entry of the scaled shape."""

    sd: float
    scaling: Scaling = "unit-norm"

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value for each entry that was measured (one less where the largest is scaled to one)."""
        found = shape_difference(pair.shape, pair.shape_gradient, pair.test_shape, self.sd, self.scaling)
        return ResidualBlock("shape", pair.case.name, pair.label, *found, self.sd)


@dataclass(frozen=True)
class MacResidual(PairResidual):
    """(1 − √MAC)/√MAC of each pair; `sd` is of that value."""

    sd: float

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value a mode."""
        found = mac_residual(pair.shape, pair.shape_gradient, pair.test_shape, self.sd)
        return ResidualBlock("shape", pair.case.name, pair.label, *found, self.sd)
