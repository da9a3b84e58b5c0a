"""Comparison of the modes of two models of one structure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Flags, Reals

RIGID_FREQUENCY_RATIO = 1e-3
"""Ratio to the highest frequency up to which a mode is a rigid-body mode.

λ is then below 1e-6 of the highest one: rounding errors of an eigen-solution are smaller, and elastic modes of the same
solution are larger by decades.
"""
LEAST_MAC = 0.7
"""Smallest MAC of partners; a customary limit, at which the angle between the shapes is 33 degrees."""
LARGEST_DIFFERENCE = 0.3
"""Largest relative difference of the frequencies of partners: models of one deck differ by far less than that."""


@dataclass(frozen=True, eq=False)
class ModesBeside:
    """Modes of an external solver compared with those of femtune's model of the deck.

    Parameters
    ----------
    configuration : the first configuration with this input of the solver
    freq_hz : (m,) of the solver
    deck_hz : (m,) of the partners in the deck
    mac : (m,) with the partners; None if the modes are compared in their order
    derivatives : True if the derivatives of the deck's model are used
    """

    configuration: str
    freq_hz: Reals
    deck_hz: Reals
    mac: Reals | None
    derivatives: bool = False

    @property
    def elastic(self) -> Flags:
        """(m,) True for elastic modes."""
        return np.asarray(self.freq_hz > RIGID_FREQUENCY_RATIO * self.freq_hz.max(initial=0.0))

    @property
    def difference(self) -> Reals:
        """(m,) relative difference of the frequencies of the deck; zero for rigid-body modes."""
        return np.where(self.elastic, self.deck_hz / np.where(self.elastic, self.freq_hz, 1.0) - 1.0, 0.0)

    @property
    def paired(self) -> Flags:
        """(m,) True for elastic modes that agree; for all elastic modes if they are compared in their order."""
        if self.mac is None:
            return self.elastic
        return self.elastic & (self.mac >= LEAST_MAC) & (np.abs(self.difference) <= LARGEST_DIFFERENCE)
