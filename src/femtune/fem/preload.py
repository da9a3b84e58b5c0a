"""Preload: the static load under which the modes of a structure are computed."""

from __future__ import annotations

from dataclasses import dataclass

from femtune.arrays import Reals


@dataclass(frozen=True, eq=False)
class Preload:
    """Loads of constant direction and magnitude, and the constraints of the static step.

    Parameters
    ----------
    forces : (n,) forces and moments on the g-set, in the displacement frames of the grid points
    acceleration : (3,) acceleration of gravity in the basic frame, acting on all mass
    support_set, multipoint_set : numbers of the sets that hold in the static step, or None
    request : the command or card that requests it, for messages
    """

    forces: Reals
    acceleration: Reals
    support_set: int | None
    multipoint_set: int | None
    request: str
