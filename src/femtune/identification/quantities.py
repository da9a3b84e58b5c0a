"""Records that mix displacements, velocities and accelerations: their mode shapes brought to one quantity."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from femtune.arrays import Complexes, Reals
from femtune.errors import FemtuneError
from femtune.modal import Channel

DERIVATIVES = {"displacement": 0, "velocity": 1, "acceleration": 2}
"""Derivatives with respect to time between a displacement and each quantity of motion."""


def derivatives_of(channels: Sequence[Channel]) -> Reals:
    """(s,) derivatives of each channel above the lowest one among them; zeros where all have one quantity.

    Raises
    ------
    FemtuneError : ``identify.mixed-quantities`` where channels of different quantities cannot be converted, or have
        units of different lengths
    """
    quantities = {c.quantity for c in channels}
    if len(quantities) < 2:
        return np.zeros(len(channels))
    _check_comparable(channels)
    orders = np.array([DERIVATIVES[c.quantity] for c in channels], dtype=float)
    return orders - orders.min()


def in_one_quantity(shapes: Complexes, poles: Complexes, derivatives: Reals) -> Complexes:
    """Shapes (s, m) of poles s (m,) as if every channel had measured the quantity with the fewest derivatives.

    A motion φ e^{st} has the velocity s φ e^{st} and the acceleration s² φ e^{st}.
    """
    return shapes / _factors(poles, derivatives) if derivatives.any() else shapes


def moved_in_one_quantity(
    shapes: Complexes, moved: Complexes, poles: Complexes, moved_poles: Complexes, derivatives: Reals
) -> Complexes:
    """First-order movements (b, s, m) of the shapes of `in_one_quantity`, of those of shapes and of poles (b, m)."""
    if not derivatives.any():
        return moved
    growth = derivatives[None, :, None] * (moved_poles / poles)[:, None, :]
    return (moved - growth * shapes) / _factors(poles, derivatives)


def _factors(poles: Complexes, derivatives: Reals) -> Complexes:
    return np.asarray(np.asarray(poles)[None, :] ** derivatives[:, None], dtype=np.complex128)


def _check_comparable(channels: Sequence[Channel]) -> None:
    by_quantity: dict[str, list[str]] = {}
    for c in channels:
        by_quantity.setdefault(c.quantity, []).append(str(c))
    values = {quantity: ", ".join(names[:5]) for quantity, names in sorted(by_quantity.items())}
    odd = sorted(set(by_quantity) - set(DERIVATIVES))
    if odd:
        code = "identify.mixed-quantities/unknown" if odd == ["unknown"] else "identify.mixed-quantities"
        raise FemtuneError(code, values=values, odd=", ".join(odd))
    for of_kind in ([c for c in channels if _turns(c) == kind] for kind in (False, True)):
        if len(lengths := sorted({word for c in of_kind if (word := _length(c.unit))})) > 1:
            units = {q: ", ".join(sorted({c.unit for c in of_kind if c.quantity == q})) for q in values}
            raise FemtuneError("identify.mixed-quantities/units", values=units, lengths=" and ".join(lengths))


def _turns(channel: Channel) -> bool:
    return channel.dof.direction.startswith("R")


def _length(unit: str) -> str:
    """The leading word of a unit: "mm" of "mm/s^2", "" where none is given."""
    match = re.match(r"\s*([^\W\d_]+)", unit)
    return match[1] if match else ""
