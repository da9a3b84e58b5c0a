"""Transverse shear with residual bending flexibility: what keeps a three-node shell from locking.

A plate whose shear stiffness an area is 𝒮 = S·t·TS and whose bending stiffness is D = B·t³·RI/12 gets the shear
flexibility 1/𝒮 + h²/(15 D): the second part is the bending within an element of size h that linear rotations
cannot show. Elements of one h² share the coefficient, which stays an exact function of all values.
Source: MacNeal, Computers and Structures 8 (1978) 175-183, residual bending flexibility.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from femtune.fem.contribution import Coefficient
from femtune.fem.elements.placement import nominal
from femtune.fem.structure import ElementBatch, Structure
from femtune.parameters.jet import Jet

SOFTENERS = ("S11", "S22", "TS", "B11", "B22", "RI", "t")
"""Values that a softened shear needs besides its own entry of the law."""


def bends(batch: ElementBatch, structure: Structure) -> NDArray[np.bool_]:
    """(e,) True where there is a bending stiffness that can be in series with the shear."""
    b11, b22, inertia = (nominal(batch, structure, role) for role in ("B11", "B22", "RI"))
    return np.asarray((b11 + b22) * inertia != 0.0)


def softened_shear(entry: str) -> Coefficient:
    """S·t·TS / (1 + h²𝒮/15D), 𝒮 and D means of both directions; fact "residual" is 12h²/15."""

    def stiffness(values: Mapping[str, Jet], facts: Mapping[str, NDArray]) -> Jet:
        bending = (values["B11"] + values["B22"]) * values["RI"] * values["t"] * values["t"]
        shear = (values["S11"] + values["S22"]) * values["TS"] * facts["residual"]
        return values[entry] * values["t"] * values["TS"] * bending / (bending + shear)

    return stiffness
