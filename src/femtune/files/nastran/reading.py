"""ElementReading: what the functions that read elements are given."""

from __future__ import annotations

from dataclasses import dataclass

from femtune.fem.structure import ElementBatch
from femtune.files.nastran.building import Building
from femtune.files.nastran.grids import Grids
from femtune.files.nastran.materials import Materials


@dataclass(frozen=True, eq=False)
class ElementReading:
    """Input of a function of `ELEMENT_READERS`, which returns batches of elements and collects errors in the building.

    Parameters
    ----------
    building : deck, value table, errors and notices
    grids : grid points with their node table
    materials : materials by number
    batches : batches that were read before
    """

    building: Building
    grids: Grids
    materials: Materials
    batches: tuple[ElementBatch, ...] = ()
