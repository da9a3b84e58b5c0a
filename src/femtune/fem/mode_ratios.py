"""Damping ratios of modes as entries of the value table, so that parameters can set them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from femtune.fem.structure import Structure
from femtune.fem.values import FieldRef, ValueTable

ALL_MODES = 0
"""The number that stands for every mode without a ratio of its own."""
MODAL = "MODAL"


def mode_ratio_field(number: int) -> FieldRef:
    """``MODAL 3 ZETA``, the damping ratio of mode 3; of every mode without one of its own ``MODAL ZETA``, number 0."""
    return FieldRef(MODAL, number, "ZETA")


def with_mode_ratios(structure: Structure, ratios: Mapping[int, float]) -> Structure:
    """The structure with damping ratios of modes, by their number from 1, or `ALL_MODES`."""
    table, first = structure.values, len(structure.values.refs)
    fields = tuple(mode_ratio_field(number) for number in ratios)
    values = np.concatenate([table.values, np.array(list(ratios.values()), float)])
    damping = replace(structure.damping, mode_ratios={n: first + i for i, n in enumerate(ratios)})
    return replace(structure, values=ValueTable((*table.refs, *fields), values, table.derived), damping=damping)
