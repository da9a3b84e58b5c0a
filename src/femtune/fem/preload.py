"""Preload: the static load under which the modes of a structure are taken."""

from __future__ import annotations

from dataclasses import dataclass

from femtune.arrays import Reals


@dataclass(frozen=True, eq=False)
class Preload:
    """Loads that keep their direction and size, and the constraints of the static step.

    Parameters
    ----------
    forces : (n,) forces and moments on the g-set, in the displacement frames of the grid points
    acceleration : (3,) acceleration of gravity in the basic frame, which acts on all mass
    support_set, multipoint_set : numbers of the sets that hold in the static step, or None
    request : what asks for it, for messages
    """

    forces: Reals
    acceleration: Reals
    support_set: int | None
    multipoint_set: int | None
    request: str
