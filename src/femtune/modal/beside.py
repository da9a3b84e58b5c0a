"""Modes of two models of one structure beside each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Flags, Reals

RIGID = 1e-3
"""Frequency over the highest one, below which a mode is a rigid-body mode."""
LEAST_MAC, LARGEST_DIFFERENCE = 0.7, 0.3
"""MAC and relative difference of frequencies, beyond which modes are no partners."""


@dataclass(frozen=True, eq=False)
class ModesBeside:
    """Modes of an external solver beside those of femtune's own model of the deck.

    Parameters
    ----------
    configuration : the first one with this input of the solver
    freq_hz : (m,) of the solver
    deck_hz : (m,) of the partners in the deck
    mac : (m,) with the partners; None where the modes are compared in their order
    derivatives : True where those of the deck are used
    """

    configuration: str
    freq_hz: Reals
    deck_hz: Reals
    mac: Reals | None
    derivatives: bool = False

    @property
    def elastic(self) -> Flags:
        """(m,) modes that are none of a rigid body."""
        return np.asarray(self.freq_hz > RIGID * self.freq_hz.max(initial=0.0))

    @property
    def difference(self) -> Reals:
        """(m,) relative difference of the frequencies of the deck; zero for rigid-body modes."""
        return np.where(self.elastic, self.deck_hz / np.where(self.elastic, self.freq_hz, 1.0) - 1.0, 0.0)

    @property
    def paired(self) -> Flags:
        """(m,) elastic modes that are alike; all of them where they are compared in their order."""
        if self.mac is None:
            return self.elastic
        return self.elastic & (self.mac >= LEAST_MAC) & (np.abs(self.difference) <= LARGEST_DIFFERENCE)
