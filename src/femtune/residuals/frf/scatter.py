"""Standard deviations of measured FRFs: a part of the magnitude, a floor, and a part from the coherence.

A weight that follows the noise of its value makes an estimate biased. Near the noise what stands for the
magnitude of a function at a line is therefore taken from the lines beside it, whose noise is another; well above it,
where peaks may be narrower than the lines, the bias is small and known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal import FrfSet

ABOVE_NOISE = 3.0
"""Logarithms are taken of values above so many standard deviations of the noise floor."""
_WELL_ABOVE = 10.0
"""Level over the noise above which a single value is known to 10 %, and needs no mean with its neighbours."""
_TRANSLATIONS = ("X", "Y", "Z")


@dataclass(frozen=True)
class FrfScatter:
    """Standard deviation of the real and of the imaginary part of measured FRFs.

    σ² = |H|²(relative² + ε²) + (floor · max|H|)², with the largest magnitude of each function, and
    ε² = (1 − γ²)/(2 γ² n) from its coherence γ² where the number n of averages is given.

    Parameters
    ----------
    relative : part of the magnitude at each line
    floor : part of the largest magnitude of the function
    averages : number of averages of the measurement; None leaves the coherence aside
    outputs : other values of `relative` for poor channels, by (node, direction) of the response
    angles : standard deviation of the rotation of a sensor about each axis, rad, by node; node 0 for all others. A
        response gets parts of the other translations that are measured at its node: σ² has ½ α² Σ|H_other|² more

    Raises
    ------
    FemtuneError : ``residual.frf-scatter`` for numbers that are negative, not finite, or all zero

    Source of ε: J. S. Bendat, A. G. Piersol, Random Data, 4th ed., Wiley 2010, section 9.2.
    """

    relative: float = 0.05
    floor: float = 0.0
    averages: int | None = None
    outputs: Mapping[tuple[int, str], float] = field(default_factory=dict)
    angles: Mapping[int, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = np.array([self.relative, self.floor, 0 if self.averages is None else self.averages - 1], float)
        if not (np.isfinite(numbers).all() and (numbers >= 0.0).all() and numbers[:2].any()):
            raise FemtuneError(
                "residual.frf-scatter",
                values={"sd": self.relative, "floor": self.floor, "averages": self.averages},
            )

    def linear(self, frfs: FrfSet) -> Reals:
        """(responses, references, lines) σ of values, in their unit; NaN where nothing is known.

        Raises
        ------
        FemtuneError : ``residual.no-coherence`` where averages are given and the functions have no coherence
        """
        before, after = beside(frfs.values)
        size = 0.5 * (np.abs(before) ** 2 + np.abs(after) ** 2)
        turned = self._turned(frfs)
        return _known(np.sqrt(size * self._relative(frfs) + turned + self._noise(frfs) ** 2), frfs.values)

    def logarithmic(self, frfs: FrfSet) -> tuple[Reals, Reals]:
        """(responses, references, lines) σ of logarithms, and what is added to those of magnitudes.

        σ is NaN where nothing is known or what is there may be noise. Well above the noise the weight is that of the
        value itself, and (floor/|H|)² makes up for what that does to the mean; lower it is that of the lines beside.
        Errors as `linear`.
        """
        noise, magnitude = self._noise(frfs), np.abs(frfs.values)
        near = np.abs(0.5 * sum(beside(frfs.values)))
        high = near > _WELL_ABOVE * noise
        part = _ratio(noise, np.where(high, magnitude, near))
        part[part >= 1.0 / ABOVE_NOISE] = np.nan
        size, turned = np.where(high, magnitude, near), self._turned(frfs)
        if self.angles:
            turned = np.divide(turned, size**2, out=np.full(size.shape, np.nan), where=size > 0.0)
        return _known(np.sqrt(self._relative(frfs) + turned + part**2), frfs.values), np.where(high, part**2, 0.0)

    def _noise(self, frfs: FrfSet) -> Reals:
        """(responses, references, 1) the floor in the unit of the functions."""
        size = np.where(np.isnan(frfs.values), 0.0, np.abs(frfs.values))
        return np.asarray(self.floor * size.max(axis=2, initial=0.0, keepdims=True))

    def _relative(self, frfs: FrfSet) -> Reals:
        """relative² + ε²."""
        by_output = [self.outputs.get((dof.node, dof.direction), self.relative) for dof in frfs.responses]
        relative = np.broadcast_to(np.square(by_output)[:, None, None], frfs.values.shape)
        if self.averages is None:
            return relative
        if frfs.coherence is None:
            raise FemtuneError("residual.no-coherence")
        known = np.where(frfs.coherence > 0.0, np.minimum(frfs.coherence, 1.0), np.nan)
        return np.asarray(relative + (1.0 - known) / (2.0 * known * self.averages))

    def _turned(self, frfs: FrfSet) -> Reals:
        """½ α² Σ|H_other|² over the other translations measured at the node of each response, in the unit squared."""
        out = np.zeros(frfs.values.shape)
        if not self.angles:
            return out
        squares = np.nan_to_num(np.abs(frfs.values)) ** 2
        for i, one in enumerate(frfs.responses):
            angle = self.angles.get(one.node, self.angles.get(0, 0.0))
            if angle and one.direction in _TRANSLATIONS:
                for j, other in enumerate(frfs.responses):
                    if other.node == one.node and other.direction in _TRANSLATIONS and other.direction != one.direction:
                        out[i] += 0.5 * angle**2 * squares[j]
        return out


def relative_sd(stated: float | None, floor: float) -> float:
    """The relative standard deviation that a study states; without one the usual one, or zero beside a noise floor."""
    if stated is not None:
        return stated
    return 0.0 if floor else FrfScatter.relative


def _ratio(noise: Reals, size: Reals) -> Reals:
    return np.divide(noise, size, out=np.full(size.shape, np.nan), where=size > 0.0)


def beside(values: Complexes) -> tuple[Complexes, Complexes]:
    """Values of the lines before and after, along the last axis; where one is missing the other, where both the own."""
    gap = np.full_like(values[:, :, :1], np.nan)
    before = np.concatenate([gap, values[:, :, :-1]], axis=2)
    after = np.concatenate([values[:, :, 1:], gap], axis=2)
    before = np.where(np.isnan(before), np.where(np.isnan(after), values, after), before)
    return before, np.where(np.isnan(after), before, after)


def _known(sd: Reals, values: Complexes) -> Reals:
    """σ where it is positive and the value is a number that is not zero."""
    good = (sd > 0.0) & np.isfinite(values) & (values != 0.0)
    return np.where(good, sd, np.nan)
