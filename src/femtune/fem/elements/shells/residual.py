"""Transverse shear with residual bending flexibility, without which three- and four-node shells are too stiff.

A plate whose shear stiffness per area is 𝒮 = S·t·TS and whose bending stiffness is D = B·t³·RI/12 gets the shear
flexibility 1/𝒮 + c h²/D: the second part is the bending within an element of size h that linear rotations cannot
represent. The coefficient stays an exact function of all values, and elements of one h² share it. Source: MacNeal,
Computers and Structures 8 (1978) 175-183, residual bending flexibility.
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

MEAN_TO_VARYING = 40.0
"""Ratio of the residual flexibilities of mean shear (h²/12D) and of shear that varies from side to side (h²/480D).

Measured: commercial Nastran has this ratio in the element matrices of a square.
"""
LARGEST_STEP = 16.0
"""Largest ratio of the h² of two neighbouring sizes.

A larger ratio gives fewer coefficients and less accurate means (see `few_sizes`).
"""
SAME_SIZE = 1e-5
"""Relative difference of h² up to which elements have one size: the rounding of coordinates in a deck."""
NEGLIGIBLE_SHARE = 1e-9
"""Share of a size up to which it is rounding error, so that the element has the other size alone."""


@dataclass(frozen=True, eq=False)
class ResidualFlexibility:
    """The factor of shear of e elements, in the wide and in the narrow direction of each.

    Both are means of the factors of k sizes; there are few sizes in all, which the elements share.

    Parameters
    ----------
    sizes : (e, k) 12 c h²
    wide, narrow : (e, k) shares of the sizes, not negative, with the sum one
    """

    sizes: Reals
    wide: Reals
    narrow: Reals

    def times(self, factor: float) -> ResidualFlexibility:
        """The same with c multiplied by a factor."""
        return replace(self, sizes=self.sizes * factor)


def of_one_size(sizes: Reals) -> ResidualFlexibility:
    """Elements of the same width in all directions; `sizes` (e,) are 12 c h²."""
    one = np.ones((len(sizes), 1))
    return ResidualFlexibility(sizes[:, None], one, one)


def few_sizes(squares: Reals) -> ResidualFlexibility:
    """Few sizes from the smallest to the largest of h² (e, 2), narrow and wide, and shares that are linear in 1/h².

    The factor 1/(1 + h²𝒮/12D) is thus a mean of those of the two sizes that enclose h. It is exact at these, and for
    any h if 𝒮 or D is much larger; otherwise it is too small by at most 1 − 4√q/(1 + √q)², q being the ratio of the h².
    """
    if not len(squares):
        return of_one_size(np.zeros(0))
    inverse = 1.0 / squares
    low, high = inverse.min(), inverse.max()
    if high < (1.0 + SAME_SIZE) * low:
        return of_one_size(np.full(len(squares), 1.0 / np.sqrt(low * high)))
    steps = int(np.ceil(np.log(high / low) / np.log(LARGEST_STEP) - NEGLIGIBLE_SHARE))
    nodes = low * (high / low) ** (np.arange(steps + 1) / steps)
    first = np.clip(np.searchsorted(nodes, inverse, side="right") - 1, 0, steps - 1)
    share = np.clip((inverse - nodes[first]) / (nodes[first + 1] - nodes[first]), 0.0, 1.0)
    share[share < NEGLIGIBLE_SHARE], share[share > 1.0 - NEGLIGIBLE_SHARE] = 0.0, 1.0
    shares = np.stack([1.0 - share, share], axis=2)
    sizes, none = 1.0 / nodes[first[:, :, None] + np.arange(2)], np.zeros_like(share)
    if steps == 1:
        return ResidualFlexibility(sizes[:, 1], shares[:, 1], shares[:, 0])
    wide, narrow = np.hstack([shares[:, 1], none]), np.hstack([none, shares[:, 0]])
    return ResidualFlexibility(np.hstack([sizes[:, 1], sizes[:, 0]]), wide, narrow)


def bends(batch: ElementBatch, structure: Structure) -> NDArray[np.bool_]:
    """(e,) True if there is a bending stiffness in series with the shear."""
    b11, b22, inertia = (nominal(batch, structure, role) for role in ("B11", "B22", "RI"))
    return np.asarray((b11 + b22) * inertia != 0.0)


def softened_shear(entry: str) -> Coefficient:
    """S·t·TS / (1 + c h²𝒮/D), 𝒮 and D being means of both directions; fact "residual" is 12 c h²."""

    def stiffness(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        bending = (values["B11"] + values["B22"]) * values["RI"] * values["t"] * values["t"]
        shear = (values["S11"] + values["S22"]) * values["TS"] * facts["residual"]
        return values[entry] * values["t"] * values["TS"] * bending / (bending + shear)

    return stiffness
