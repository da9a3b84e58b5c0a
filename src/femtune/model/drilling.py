"""Modes that depend on the drilling stiffness of shells, which has no physical meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from femtune.fem.drilling import drilling_energies
from femtune.model.eigen.solution import EigenSolution
from femtune.model.response.rigid import is_rigid

MOST_ENERGY = 0.02
"""Share of the strain energy up to which drilling is negligible: twice the K6ROT changes the frequency by 1 %."""
_MAIN_PART = 0.9
"""Part of the drilling energy of a mode whose grid points are named."""


@dataclass(frozen=True)
class DrillingMode:
    """A mode whose frequency depends on K6ROT.

    Parameters
    ----------
    number : from 1
    share : of the drilling stiffness in the mode's strain energy
    grids : grid points that have nine tenths of this energy, the largest first
    """

    number: int
    freq_hz: float
    share: float
    grids: tuple[int, ...]


def drilling_modes(solution: EigenSolution) -> Iterator[DrillingMode]:
    """The wanted elastic modes in which drilling has more than `MOST_ENERGY` of the strain energy."""
    configured = solution.point.configured
    structure, elastic = configured.model.structure, ~is_rigid(solution)[: solution.wanted]
    if not structure.batches or structure.drilling == 0.0:
        return
    values = replace(structure.values, values=configured.model.table(solution.point.x).value)
    shapes = configured.transformation @ solution.shapes[:, : solution.wanted]
    energies = drilling_energies(replace(structure, values=values), shapes, configured.configuration.elements_off)
    shares = energies.sum(axis=0)[elastic] / solution.eigenvalues[: solution.wanted][elastic]
    for mode, share in zip(np.flatnonzero(elastic), shares):
        if share > MOST_ENERGY:
            energy = energies[:, mode]
            order = np.argsort(energy)[::-1]
            count = int(np.searchsorted(np.cumsum(energy[order]), _MAIN_PART * energy.sum())) + 1
            grids = tuple(int(n) for n in structure.nodes.ids[order[:count]])
            yield DrillingMode(int(mode) + 1, float(solution.freq_hz[mode]), float(share), grids)
