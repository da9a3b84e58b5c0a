"""Mode-shape residuals: the difference of shapes that are scaled alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import DofSet
from femtune.errors import FemtuneError
from femtune.residuals.block import ResidualBlock
from femtune.residuals.case import PairedMode
from femtune.residuals.pair import PairResidual
from femtune.residuals.scaling import Scaling, scaled_difference
from femtune.residuals.weights import Weights, as_weights, weighted_block

Reals = NDArray[np.float64]
Places = NDArray[np.int64]


def shape_difference(
    shape: Reals, gradient: Reals, test: Reals, sd: float, scaling: Scaling = "unit-norm"
) -> tuple[Reals, Reals]:
    """(φ − φ_e)/σ over the measured entries, both shapes scaled in the same way; see `scaled_difference`."""
    values, jacobian, _ = scaled_difference(shape, gradient, test, scaling)
    return values / sd, jacobian / sd


@dataclass(frozen=True, eq=False)
class ShapeResidual(PairResidual):
    """Differences of shapes that are scaled alike.

    Parameters
    ----------
    weights : standard deviation of an entry of the scaled shape, or weights of the sensors' entries in their order
    scaling : see `scaled_difference`
    sensors : those that are compared, as far as the test has them; all where None. Their entries alone are scaled
    kind : what the report calls it: "shape", or "strain" where the sensors are strain gauges
    """

    weights: float | Weights
    scaling: Scaling = "unit-norm"
    sensors: DofSet | None = None
    kind: str = "shape"

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value for each entry that was measured (one less where the largest is scaled to one).

        Raises
        ------
        FemtuneError : ``residual.not-mass-scaled``; ``residual.unmeasured`` where no entry was measured
        """
        if self.scaling == "mass":
            check_mass_scaled(pair)
        weights, known = as_weights(self.weights), pair.case.test.dofs
        weights.check_size(len(known if self.sensors is None else self.sensors), f"the sensors of mode {pair.label}")
        which, at = self._places(known)
        test = pair.test_shape[at]
        measured = int((~np.isnan(test)).sum())
        if measured <= (self.scaling != "mass") or not np.nan_to_num(test).any():
            raise _unmeasured(pair, measured)
        errors, slopes, kept = scaled_difference(pair.shape[at], pair.shape_gradient[at], test, self.scaling)
        return weighted_block(self.kind, pair.case.name, pair.label, errors, slopes, weights.of(which[kept]))

    def _places(self, known: DofSet) -> tuple[Places, Places]:
        """Positions among the sensors of the residual, and among those of the test."""
        if self.sensors is None:
            return np.arange(len(known)), np.arange(len(known))
        found = {(d.node, d.direction): i for i, d in enumerate(known)}
        pairs = [(k, found.get((d.node, d.direction), -1)) for k, d in enumerate(self.sensors)]
        both = np.array([(k, i) for k, i in pairs if i >= 0], dtype=np.int64).reshape(-1, 2)
        return both[:, 0], both[:, 1]


def check_mass_scaled(pair: PairedMode) -> None:
    """Refuse a test whose shapes are not of unit modal mass (error ``residual.not-mass-scaled``)."""
    if pair.case.test.normalisation != "mass":
        raise FemtuneError(
            "residual.not-mass-scaled",
            f"configuration {pair.case.name}: the test's shapes are not mass-normalised, and this residual needs it",
            values={"normalisation of the test": pair.case.test.normalisation},
            hint="measure with known input and scale the shapes to unit modal mass, or take a residual that needs none",
        )


def _unmeasured(pair: PairedMode, known: int) -> FemtuneError:
    return FemtuneError(
        "residual.unmeasured",
        f"configuration {pair.case.name}: mode {pair.label} has too few measured entries to compare its shape",
        values={"measured entries": known},
        hint="name sensors that were measured, or leave this mode out",
    )
