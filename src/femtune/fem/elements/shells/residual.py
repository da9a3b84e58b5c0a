"""Transverse shear with residual bending flexibility: what keeps three- and four-node shells from being too stiff.

A plate whose shear stiffness an area is 𝒮 = S·t·TS and whose bending stiffness is D = B·t³·RI/12 gets the shear
flexibility 1/𝒮 + c h²/D: the second part is the bending within an element of size h that linear rotations cannot show.
The coefficient stays an exact function of all values, and elements of one h² share it. Source: MacNeal, Computers and
Structures 8 (1978) 175-183, residual bending flexibility.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from femtune.arrays import Reals
from femtune.fem.contribution import Coefficient
from femtune.fem.elements.placement import nominal
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

SOFTENERS = ("S11", "S22", "TS", "B11", "B22", "RI", "t")
"""Values that a softened shear needs besides its own entry of the law."""

# of the shear that alternates from side to side the residual flexibility is h²/480D, h the size across, and of the mean
# h²/12D, h the size along: so it is in element matrices that commercial Nastran wrote of a square
VARYING = 40.0
# ratio of the h² of two neighbouring sizes, at most
STEP = 16.0
# relative difference of h² below which elements have one size: the digits of a deck
ALIKE = 1e-5
# share of a size below which its neighbour alone stands for it
NEGLIGIBLE = 1e-9


@dataclass(frozen=True, eq=False)
class ResidualFlexibility:
    """The factor of shear of e elements, in the direction in which each is wide and in that in which it is narrow.

    Both are means of the factors of k sizes, few of which the elements share.

    Parameters
    ----------
    sizes : (e, k) 12 c h²
    wide, narrow : (e, k) shares of the sizes, not negative, with the sum one
    """

    sizes: Reals
    wide: Reals
    narrow: Reals

    def times(self, factor: float) -> ResidualFlexibility:
        """The same with another c."""
        return replace(self, sizes=self.sizes * factor)


def of_one_size(sizes: Reals) -> ResidualFlexibility:
    """Elements that are as wide in all directions; `sizes` (e,) are 12 c h²."""
    one = np.ones((len(sizes), 1))
    return ResidualFlexibility(sizes[:, None], one, one)


def few_sizes(squares: Reals) -> ResidualFlexibility:
    """Few sizes from the smallest to the largest of h² (e, 2), narrow and wide, and shares that are linear in 1/h².

    The factor 1/(1 + h²𝒮/12D) is so a mean of those of the two sizes that enclose h. It is exact at these, and for any
    h where 𝒮 or D is by far the larger; between, it is too small by 1 − 4√q/(1 + √q)² at most, q the ratio of the h².
    """
    if not len(squares):
        return of_one_size(np.zeros(0))
    inverse = 1.0 / squares
    low, high = inverse.min(), inverse.max()
    if high < (1.0 + ALIKE) * low:
        return of_one_size(np.full(len(squares), 1.0 / np.sqrt(low * high)))
    steps = int(np.ceil(np.log(high / low) / np.log(STEP) - NEGLIGIBLE))
    nodes = low * (high / low) ** (np.arange(steps + 1) / steps)
    first = np.clip(np.searchsorted(nodes, inverse, side="right") - 1, 0, steps - 1)
    share = np.clip((inverse - nodes[first]) / (nodes[first + 1] - nodes[first]), 0.0, 1.0)
    share[share < NEGLIGIBLE], share[share > 1.0 - NEGLIGIBLE] = 0.0, 1.0
    shares = np.stack([1.0 - share, share], axis=2)
    sizes, none = 1.0 / nodes[first[:, :, None] + np.arange(2)], np.zeros_like(share)
    if steps == 1:
        return ResidualFlexibility(sizes[:, 1], shares[:, 1], shares[:, 0])
    wide, narrow = np.hstack([shares[:, 1], none]), np.hstack([none, shares[:, 0]])
    return ResidualFlexibility(np.hstack([sizes[:, 1], sizes[:, 0]]), wide, narrow)


def bends(batch: ElementBatch, structure: Structure) -> NDArray[np.bool_]:
    """(e,) True where there is a bending stiffness that can be in series with the shear."""
    b11, b22, inertia = (nominal(batch, structure, role) for role in ("B11", "B22", "RI"))
    return np.asarray((b11 + b22) * inertia != 0.0)


def softened_shear(entry: str) -> Coefficient:
    """S·t·TS / (1 + c h²𝒮/D), 𝒮 and D means of both directions; fact "residual" is 12 c h²."""

    def stiffness(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        bending = (values["B11"] + values["B22"]) * values["RI"] * values["t"] * values["t"]
        shear = (values["S11"] + values["S22"]) * values["TS"] * facts["residual"]
        return values[entry] * values["t"] * values["TS"] * bending / (bending + shear)

    return stiffness
