"""Masses that a model does not have: sensors, motors, cables, equipment that a deck leaves out.

Grid points without a mass of their own are grouped by neighbourhood, and each group is given one mass, spread evenly
over its points: a point mass nearby moves the modes like it. The masses are zero, so that nothing changes; their
derivatives are those of a mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from femtune.arrays import Flags, Integers, Reals
from femtune.fem import FieldRef, Structure
from femtune.fem.elements.discrete import CONCENTRATED_MASS, GENERAL_MASS, SCALAR_MASS
from femtune.fem.structure import ElementBatch
from femtune.fem.values import ValueTable
from femtune.model import Assignment, ConfiguredModel
from femtune.parameters import Parameter

_OF_MASSES = (CONCENTRATED_MASS.key, GENERAL_MASS.key, SCALAR_MASS.key)


@dataclass(frozen=True)
class PointMass:
    """A mass at some grid points of a neighbourhood, zero unless a parameter moves it.

    Parameters
    ----------
    name : an identifier that no parameter has
    points : numbers of the grid points that it is spread over
    largest : plausible mass, in the mass unit of the deck
    """

    name: str
    points: tuple[int, ...]
    largest: float

    @property
    def parameter(self) -> Parameter:
        """The mass at each of the points, from zero."""
        return Parameter(self.name, 0.0, 0.0, self.largest / len(self.points))


def points_without_mass(structure: Structure, configured: Sequence[ConfiguredModel]) -> Integers:
    """Rows of the grid points of elements that carry no mass of their own and can move in some configuration."""
    n = len(structure.nodes.ids)
    used, heavy, moves = np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, bool)
    for batch in structure.batches:
        points = np.unique(batch.dofs[(batch.dofs >= 0) & (batch.dofs < 6 * n)] // 6)
        (heavy if batch.kind in _OF_MASSES else used)[points] = True
    for state in configured:
        free = np.diff(state.transformation.indptr)[: 6 * n].reshape(n, 6) > 0
        moves |= free[:, :3].any(axis=1)
    return np.flatnonzero(used & ~heavy & moves)


def neighbourhoods(xyz: Reals, most: int) -> list[Integers]:
    """At most `most` groups of nearby points: the widest group is halved across its longest direction, again and again.

    Parameters
    ----------
    xyz : (n, 3)

    Examples
    --------
    >>> line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [9, 0, 0]])
    >>> [group.tolist() for group in neighbourhoods(line, 3)]
    [[0], [1, 2], [3]]
    """
    groups = [np.arange(len(xyz))] if len(xyz) else []
    while 0 < len(groups) < most:
        widths = [float(np.ptp(xyz[g], axis=0).max()) for g in groups]
        widest = int(np.argmax(widths))
        if widths[widest] <= 0.0:
            break
        group = groups.pop(widest)
        groups += [group[side] for side in _halves(xyz[group])]
    return sorted(groups, key=lambda g: int(g[0]))


def _halves(xyz: Reals) -> tuple[Flags, Flags]:
    """Points on either side of the middle of the box around them, across its longest direction."""
    axis = int(np.argmax(np.ptp(xyz, axis=0)))
    along = xyz[:, axis]
    upper = along > 0.5 * (along.min() + along.max())
    return ~upper, upper


def with_point_masses(structure: Structure, masses: Sequence[PointMass]) -> tuple[Structure, list[Assignment]]:
    """The structure with further masses, and the assignments that make them parameters, which set them to zero."""
    table, nodes = structure.values, structure.nodes
    first = 1 + max([0, *(int(b.ids.max()) for b in structure.batches if len(b)), *structure.element_kinds])
    rows = [np.array([nodes.position(p) for p in mass.points], np.int64) for mass in masses]
    at = np.concatenate([np.zeros(0, np.int64), *rows])
    ids = np.repeat(first + np.arange(len(at)), 3)
    owner = np.repeat(np.repeat(np.arange(len(masses)), [len(r) for r in rows]), 3)
    dofs = (6 * at[:, None] + np.arange(3)).ravel()
    ground = np.full(len(ids), -1, np.int64)
    refs = [FieldRef("CMASS2", int(ids[np.argmax(owner == k)]), "M") for k in range(len(masses))]
    values = np.array([mass.largest / len(mass.points) for mass in masses])
    batch = ElementBatch(
        SCALAR_MASS.key, "CMASS2", ids, np.column_stack([np.repeat(at, 3), ground]), np.column_stack([dofs, ground]),
        {"M": len(table.refs) + owner},
    )  # fmt: skip
    wide = replace(
        structure, values=ValueTable((*table.refs, *refs), np.concatenate([table.values, values]), table.derived),
        batches=(*structure.batches, batch),
        element_kinds={**structure.element_kinds, **dict.fromkeys(map(int, ids), "CMASS2")},
    )  # fmt: skip
    return wide, [Assignment(m.name, ref, relative=False) for m, ref in zip(masses, refs)]
