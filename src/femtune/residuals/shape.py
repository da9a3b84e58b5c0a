"""Mode-shape residuals: the difference of shapes that are scaled alike."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.correlation import SensorPlacement
from femtune.dofs import Dof, DofSet, parse_dof
from femtune.errors import FemtuneError, did_you_mean
from femtune.modal import ModeSet
from femtune.model import EigenSolution
from femtune.residuals.asked import Asked, asked_weights, check_asked_mass_scaled
from femtune.residuals.case import ComparedCase, PairedMode
from femtune.residuals.kinds import ShapeScaling
from femtune.residuals.pair import PairResidual
from femtune.residuals.weights import ResidualBlock, Weights, as_weights

# ----------------------------------------------------------------------------------------------------
# Scales in which a model shape is compared with a test shape, and the derivative of each.


Scaled = tuple[Reals, Reals, NDArray[np.int64]]


def scaled_difference(shape: Reals, gradient: Reals, test: Reals, scaling: ShapeScaling = "unit-norm") -> Scaled:
    """Differences of a model shape and a test shape in one scale, their Jacobian, and the positions compared.

    Parameters
    ----------
    shape, gradient : (s,) and (s, k) model shape at the sensors; of unit modal mass for "mass", in any scale otherwise
    test : (s,) test shape; NaN entries were not measured and are left out
    scaling :
        "unit-norm", both of unit Euclidean norm over what was measured: |difference| = √(2(1 − √MAC));
        "largest-entry", both one where the test is largest, and that entry left out;
        "scale-factor", the model by the modal scale factor φᵀψ/φᵀφ, which makes the difference least, over |ψ|:
        |difference| = √(1 − MAC);
        "mass", as they are, both of unit modal mass, over |ψ|; only the sign is aligned
    """
    known = np.flatnonzero(~np.isnan(test))
    phi, slope, reference = shape[known], gradient[known], test[known]
    if scaling == "largest-entry":
        values, jacobian, rest = _largest_entry(phi, slope, reference)
        return values, jacobian, known[rest]
    of = {"unit-norm": _unit_norm, "scale-factor": _scale_factor, "mass": _mass}[scaling]
    values, jacobian = of(phi, slope, reference)
    return values, jacobian, known


def _unit_norm(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    norm = np.sign(phi @ test or 1.0) * np.linalg.norm(phi)
    unit = phi / norm
    return unit - test / np.linalg.norm(test), (slope - np.outer(unit, unit @ slope)) / norm


def _largest_entry(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals, NDArray[np.bool_]]:
    top = int(np.argmax(np.abs(test)))
    rest = np.arange(len(test)) != top
    # a model that does not move there is infinitely far from the test, which a search refuses
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = phi / phi[top]
        jacobian = (slope - np.outer(ratio, slope[top])) / phi[top]
    return (ratio - test / test[top])[rest], jacobian[rest], rest


def _scale_factor(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    square = phi @ phi
    factor = phi @ test / square
    d_factor = (test - 2.0 * factor * phi) @ slope / square
    size = np.linalg.norm(test)
    return (factor * phi - test) / size, (factor * slope + np.outer(phi, d_factor)) / size


def _mass(phi: Reals, slope: Reals, test: Reals) -> tuple[Reals, Reals]:
    side, size = np.sign(phi @ test or 1.0), np.linalg.norm(test)
    return (side * phi - test) / size, side * slope / size


Places = NDArray[np.int64]


def scale_of(test: Reals, scaling: ShapeScaling) -> float:
    """Divisor of the measured entries: their norm, or their largest entry."""
    known = test[~np.isnan(test)]
    return float(np.abs(known).max() if scaling == "largest-entry" else np.linalg.norm(known))


def placement_covariance(
    placement: SensorPlacement, solution: EigenSolution, case: ComparedCase, members: Sequence[int], test: Reals
) -> Reals:
    """(s, s) covariance of the entries of a test shape from errors of the sensors' placement, in its own scale.

    The motion is that combination of some model modes that fits the test shape best.
    """
    shapes = solution.shapes[:, list(members)]
    known = ~np.isnan(test)
    mixture = np.linalg.lstsq((case.sensors @ shapes)[known], test[known], rcond=None)[0]
    return placement.covariance(case.configured.transformation @ (shapes @ mixture))


_FROM_THE_SHAPE = ("unit-norm", "scale-factor")
"""Scales that follow from all entries of the shape: one combination of the differences is zero whatever the noise."""


def noise_of_scaling(test: Reals, scaling: ShapeScaling) -> Reals:
    """(m, n) matrix that takes errors of the n measured entries of a scaled test shape to the m differences.

    To first order about a right model, and but for the sign. A scale that follows from the shape itself takes the part
    along the shape away; a scale by one entry brings the error of that entry to all others.
    """
    one = np.eye(len(test))
    if scaling == "mass":
        return one
    if scaling != "largest-entry":
        return np.asarray(one - np.outer(test, test) / (test @ test))
    top = int(np.argmax(np.abs(test)))
    return np.asarray(np.delete(one - np.outer(test / test[top], one[top]), top, axis=0))


@dataclass(frozen=True, eq=False)
class ShapeResidual(PairResidual):
    """Differences of shapes that are scaled alike.

    Of n measured entries n − 1 are independent where the scale follows from the shape itself ("unit-norm",
    "scale-factor") and where the largest entry is scaled to one, which is then no residual; n by modal mass.

    Parameters
    ----------
    weights : standard deviation of an entry of the scaled shape, or weights of the sensors' entries in their order;
        "test": those of the entries of the test (error ``residual.no-scatter`` where it gives none)
    scaling : see `scaled_difference`
    sensors : those that are compared, as far as the test has them; all where None. Their entries alone are scaled
    placement : errors in the positions and directions of the sensors, whose covariance is added to that of `weights`.
        It is computed from the motion of the model at the first evaluation of a mode, on the full model, and kept
    of_largest : `weights` is a standard deviation relative to the largest measured entry of each shape, as that of
        [plan], [validate] and simulated tests
    """

    weights: float | Weights | Literal["test"]
    scaling: ShapeScaling = "unit-norm"
    sensors: DofSet | None = None
    placement: SensorPlacement | None = None
    of_largest: bool = False
    _placed: dict[str, Reals] = field(default_factory=dict, repr=False)
    key = "shape"
    label = "shape"

    @property
    def of_ratio(self) -> bool:
        """See `Residual`."""
        return self.scaling != "mass"

    @classmethod
    def of_study(cls, asked: Asked) -> ShapeResidual:
        """See `Residual`; errors ``dof.missing``, ``residual.not-mass-scaled``, ``residual.weights`` …"""
        entry, dofs = asked.entry, asked.modes.dofs
        if entry.scaling == "mass":
            check_asked_mass_scaled(asked)
        sensors = dofs if entry.sensors is None else DofSet(_asked_sensors(asked, entry.sensors))
        placement = asked.placement if cls.key == "shape" else None
        if entry.covariance is None and entry.sd in (None, "test"):
            if asked.modes.shapes_sd is None:
                raise FemtuneError("residual.no-scatter/shape", where=asked.where(), configuration=asked.name)
            return cls("test", entry.scaling, sensors, placement)
        return cls(
            asked_weights(asked, len(sensors), "the sensors"), entry.scaling, sensors, placement, asked.of_largest
        )

    def without_sd(self, test: ModeSet) -> tuple[int, ...]:
        """See `OfPairs`."""
        if self.weights != "test":
            return ()
        if test.shapes_sd is None:
            return tuple(range(len(test)))
        at = self._places(test.dofs)[1]
        measured, sd = ~np.isnan(test.shapes[at]), test.shapes_sd[at]
        known = ~(measured & np.isnan(sd)).any(axis=0) & (measured & (sd > 0.0)).any(axis=0)
        return tuple(np.flatnonzero(~known).tolist())

    def of_pair(self, pair: PairedMode) -> ResidualBlock:
        """One value for each entry that was measured (one less where the largest is scaled to one).

        Raises
        ------
        FemtuneError : ``residual.not-mass-scaled``; ``residual.unmeasured`` where no entry was measured
        """
        if self.scaling == "mass":
            check_mass_scaled(pair)
        known = pair.case.test.dofs
        which, at = self._places(known)
        test = pair.test_shape[at]
        count = len(known if self.sensors is None else self.sensors)
        measured = int((~np.isnan(test)).sum())
        if measured <= (self.scaling != "mass") or not np.nan_to_num(test).any():
            raise _unmeasured(pair, measured)
        weights = self._of_test(pair, which, at, count) if self.weights == "test" else self._given(test)
        weights.check_size(count, f"the sensors of mode {pair.label}")
        weights = self._with_placement(pair, weights, test)
        errors, slopes, kept = scaled_difference(pair.shape[at], pair.shape_gradient[at], test, self.scaling)
        weights_of_pair = weights.of(which[kept])
        values, slopes = weights_of_pair.whiten(errors, slopes)
        lost = pair.turned + (self.scaling in _FROM_THE_SHAPE)
        covariance = self._covariance(test, weights, which, weights_of_pair)
        block = self.block(
            pair.case.name, pair.label, values, slopes, weights_of_pair.scale, lost=lost, covariance=covariance
        )
        labels = tuple(str(known[int(i)]) for i in at[kept])
        block = replace(block, sensors=labels, scaled=self._scaled(test, covariance))
        return block.whitened() if self.weights == "test" else block

    def _scaled(self, test: Reals, covariance: Reals | None) -> Reals | None:
        """(n,) the combination of equally weighted values that is lost to a scale that follows from the shape."""
        if covariance is not None or self.scaling not in _FROM_THE_SHAPE:
            return None
        measured = test[~np.isnan(test)]
        return np.asarray(measured / np.linalg.norm(measured))

    def _given(self, test: Reals) -> Weights:
        """The weights, in the scale in which a test shape is compared."""
        weights = as_weights(self.weights)  # type: ignore[arg-type]
        if not self.of_largest or weights.sd is None:
            return weights
        ratio = float(np.nanmax(np.abs(test))) / scale_of(test, self.scaling)
        return Weights(np.asarray(weights.sd, dtype=float) * ratio)

    def _of_test(self, pair: PairedMode, which: Places, at: Places, count: int) -> Weights:
        """The test's standard deviations of the entries, scaled as its shape is.

        An entry to which the test scales its shape has none of its own: its error is in all others. It gets the root
        mean square of the others.
        """
        if pair.case.test.shapes_sd is None:
            raise FemtuneError("residual.no-scatter/shape", configuration=pair.case.name)
        test, sd = pair.test_shape[at], np.array(pair.case.test.shapes_sd[at, pair.position])
        known = ~np.isnan(test)
        positive = known & (sd > 0.0)
        if np.isnan(sd[known]).any() or not positive.any():
            raise FemtuneError("residual.no-scatter/entries", configuration=pair.case.name, mode=pair.label)
        sd[known & (sd == 0.0)] = np.sqrt(np.mean(sd[positive] ** 2))
        size = scale_of(test, self.scaling)
        # what was not measured is not compared
        scaled = np.ones(count)
        scaled[which] = np.where(known, sd / size, 1.0)
        return Weights(scaled)

    def _with_placement(self, pair: PairedMode, weights: Weights, test: Reals) -> Weights:
        """The weights of all sensors with the covariance that errors of their placement add."""
        if self.placement is None:
            return weights
        if pair.label not in self._placed and pair.state is not None and pair.case.full is None:
            self._placed[pair.label] = placement_covariance(
                self.placement, pair.state.solution, pair.case, pair.members, pair.test_shape
            )
        if pair.label not in self._placed:
            return weights
        sensors = pair.case.test.dofs if self.sensors is None else self.sensors
        at, sign = sensors.align(self.placement.dofs)
        root = weights.root(len(sensors))
        size = scale_of(test, self.scaling)
        added = self._placed[pair.label][np.ix_(at, at)] * np.outer(sign, sign) / size**2
        return Weights(covariance=root @ root.T + added)

    def _covariance(self, test: Reals, weights: Weights, which: Places, own: Weights) -> Reals | None:
        """Covariance of the residuals; None if it is the identity, but for what is lost to the scale."""
        if self.scaling == "mass" or (self.scaling in _FROM_THE_SHAPE and weights.size is None):
            return None
        known = np.flatnonzero(~np.isnan(test))
        noise = noise_of_scaling(test[known], self.scaling)
        of_all = own if len(noise) == len(known) else weights.of(which[known])
        spread = own.whiten(np.zeros(len(noise)), noise @ of_all.root(len(known)))[1]
        return np.asarray(spread @ spread.T)

    def _places(self, known: DofSet) -> tuple[Places, Places]:
        """Positions among the sensors of the residual, and among those of the test."""
        if self.sensors is None:
            return np.arange(len(known)), np.arange(len(known))
        place_of = {(d.node, d.direction): i for i, d in enumerate(known)}
        pairs = [(k, place_of.get((d.node, d.direction), -1)) for k, d in enumerate(self.sensors)]
        both = np.array([(k, i) for k, i in pairs if i >= 0], dtype=np.int64).reshape(-1, 2)
        return both[:, 0], both[:, 1]


class StrainResidual(ShapeResidual):
    """The same for strain shapes, at the sensors of the test that are strain gauges."""

    key = "strain"
    label = "strain"


def _asked_sensors(asked: Asked, labels: Iterable[str]) -> Iterator[Dof]:
    """Sensors of the test's modes."""
    known = {(d.node, d.direction): d for d in asked.modes.dofs}
    for i, label in enumerate(labels):
        dof = parse_dof(label)
        if (dof.node, dof.direction) not in known:
            raise FemtuneError(
                "dof.missing/in-modes",
                where=asked.where("sensors", i),
                hint=did_you_mean(label, map(str, asked.modes.dofs)),
                configuration=asked.name,
                label=label,
            )
        yield known[dof.node, dof.direction]


def check_mass_scaled(pair: PairedMode) -> None:
    """Refuse a test whose shapes are not of unit modal mass (error ``residual.not-mass-scaled``)."""
    if pair.case.test.normalisation != "mass":
        raise FemtuneError(
            "residual.not-mass-scaled/pair",
            values={"normalisation of the test": pair.case.test.normalisation},
            configuration=pair.case.name,
        )


def _unmeasured(pair: PairedMode, known: int) -> FemtuneError:
    return FemtuneError(
        "residual.unmeasured/shape",
        values={"measured entries": known},
        configuration=pair.case.name,
        mode=pair.label,
    )
