"""MAC residuals: one value a mode, zero where the shapes are parallel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.residuals.asked import Asked
from femtune.residuals.case import PairedMode
from femtune.residuals.kinds import MacForm
from femtune.residuals.pair import PairResidual
from femtune.residuals.weights import ResidualBlock


def mac_residual(shape: Reals, gradient: Reals, test: Reals, sd: float, form: MacForm = "root") -> tuple[Reals, Reals]:
    """A function of the MAC over σ, (1,) and (1, k).

    Parameters
    ----------
    shape, gradient : (s,) and (s, k) model shape at the sensors, in any scale
    test : (s,) test shape; NaN entries are left out
    form : "root" (1 − √MAC)/√MAC, "ratio" (1 − MAC)/MAC, "difference" 1 − MAC
    """
    root, slope = _root(shape, gradient, test)
    value, d_root = {
        "root": ((1.0 - root) / root, -1.0 / root**2),
        "ratio": ((1.0 - root**2) / root**2, -2.0 / root**3),
        "difference": (1.0 - root**2, -2.0 * root),
    }[form]
    return np.array([value / sd]), (d_root * slope / sd)[None, :]


def _root(shape: Reals, gradient: Reals, test: Reals) -> tuple[float, Reals]:
    """√MAC and its gradient."""
    known = ~np.isnan(test)
    phi, slope, reference = shape[known], gradient[known], test[known] / np.linalg.norm(test[known])
    inner = float(phi @ reference)
    side = np.sign(inner) or 1.0
    norm = np.linalg.norm(phi)
    root = side * inner / norm
    return float(root), side * (reference @ slope) / norm - root * (phi @ slope) / norm**2


@dataclass(frozen=True)
class MacResidual(PairResidual):
    """A function of the MAC of each pair; `sd` is of that value.

    Its Jacobian vanishes where the shapes agree, so data determine shapes through it to second order only.
    """

    sd: float
    form: MacForm = "root"
    key = "mac"
    label = "MAC"
    not_normal = (
        "1 − MAC is a quadratic form of the noise, and is tested where the standard deviations of the shapes are "
        "known (shape_sd of [validate])"
    )

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return True

    @classmethod
    def of_study(cls, asked: Asked) -> MacResidual:
        """See `Residual`."""
        _ = asked.modes
        return cls(asked.entry.sd, asked.entry.form)

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value a mode."""
        block = mac_residual(pair.shape, pair.shape_gradient, pair.test_shape, self.sd, self.form)
        return self.block(pair.case.name, pair.label, *block, self.sd)
