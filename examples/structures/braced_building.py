"""The two-storey benchmark building with its upper braces, on a ground that shakes and hums.

The braces work as appendages tuned to the fourth mode of the frame (transverse, out of phase), which they split into
two modes, 4a and 4b. Source: the paper on robust model updating of a benchmark building, Tables 1
and 2, Figures 4 to 6; plane frames after its section 3, joint rotations condensed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from femtune.arrays import Reals
from femtune.dofs import Dof, DofSet
from structures.laboratory import Plant, on_shaking_ground

LENGTH_X, LENGTH_Y, STOREY = 4.0, 3.0, 2.0
YOUNG, SHEAR = 206e9, 79.2e9
COLUMN_X, COLUMN_Y, BEAM, COLUMN_TORSION = 1.509e-5, 0.550e-5, 1.317e-5, 2.0e-7
SLAB = (3539.0, 7702.0)
STEEL = ((530.0, 2740.0), (473.0, 2290.0))
BRACE_MASS, BRACE_HZ = 140.0, 10.0
"""Of both upper braces together, which swing alike across the building (y)."""
DAMPING_RATIO = 0.0025
HUM_HZ = 7.8

_BLOCKS = (
    (0, 338.0, -0.95, -1.00, ("NC", "SC")),
    (0, 340.0, 0.95, -1.00, ("NC", "SC")),
    (0, 336.0, -0.95, 1.00, ("SC",)),
    (0, 336.0, 0.95, 1.00, ("SC",)),
    (1, 336.0, -0.95, -1.00, ("NC", "SC")),
    (1, 340.0, 0.95, -1.00, ("NC", "SC")),
    (1, 338.0, -0.95, 1.00, ("SC",)),
    (1, 330.0, 0.95, 1.00, ("SC",)),
)

CORNERS = ((-LENGTH_X / 2, -LENGTH_Y / 2), (LENGTH_X / 2, LENGTH_Y / 2))
SENSORS = DofSet(Dof(10 * floor + corner, d) for floor in (1, 2) for corner in (1, 2) for d in ("X", "Y"))
"""Accelerometers in pairs at two opposite corners of floors 1 and 2: 11X+, 11Y+, 12X+ …"""
GROUND = DofSet((Dof(1, "X"), Dof(1, "Y"), Dof(1, "RZ")))
"""The ground moves along x and y and turns a little, which alone drives the twisting modes of the symmetric states."""


@dataclass(frozen=True, eq=False)
class BracedBuilding:
    """The building in one mass configuration.

    Parameters
    ----------
    plant : its eight sensors under accelerations of the ground along x and y and about z
    floors : (8, 6) rows of the sensors in the rigid motion (x, y, rotation) of floors 1 and 2
    """

    plant: Plant
    floors: Reals


def braced_building(configuration: str, brace_mass: float = BRACE_MASS) -> BracedBuilding:
    """The building bare ("BC"), with blocks on one side ("NC") or on both ("SC").

    Without brace mass it is the frame alone, whose fourth mode is whole.
    """
    mass, stiffness = _mass(configuration), _stiffness()
    if brace_mass:
        mass, stiffness = _with_braces(mass, stiffness, brace_mass)
    n = len(mass)
    floors = sensor_rows()
    outputs = np.hstack([floors, np.zeros((len(floors), n - 6))])
    carried = np.zeros((n, 3))
    carried[[0, 3], 0], carried[[1, 4], 1], carried[6:, 1], carried[[2, 5], 2] = 1.0, 1.0, 1.0, 1.0
    plant = on_shaking_ground(mass, stiffness, DAMPING_RATIO, outputs, SENSORS, carried, GROUND)
    return BracedBuilding(plant, floors)


def sensor_rows() -> Reals:
    """(8, 6) what each sensor sees of the rigid motions of the floors about their centroids."""
    rows = []
    for floor in (0, 1):
        for x, y in CORNERS:
            for direction, arm in (((1.0, 0.0), -y), ((0.0, 1.0), x)):
                row = np.zeros(6)
                row[3 * floor : 3 * floor + 3] = (*direction, arm)
                rows.append(row)
    return np.array(rows)


def _mass(configuration: str) -> Reals:
    mass = np.zeros((6, 6))
    for floor, (slab, steel) in enumerate(zip((SLAB, SLAB), STEEL)):
        at = slice(3 * floor, 3 * floor + 3)
        mass[at, at] += np.diag((slab[0] + steel[0], slab[0] + steel[0], slab[1] + steel[1]))
    for floor, m, x, y, where in _BLOCKS:
        if configuration in where:
            arm = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])
            at = slice(3 * floor, 3 * floor + 3)
            mass[at, at] += m * arm.T @ arm
    return mass


def _stiffness() -> Reals:
    kx, ky = _frames(COLUMN_X, LENGTH_X), _frames(COLUMN_Y, LENGTH_Y)
    twist = kx * (LENGTH_Y / 2) ** 2 + ky * (LENGTH_X / 2) ** 2
    twist += 4.0 * SHEAR * COLUMN_TORSION / STOREY * np.array([[2.0, -1.0], [-1.0, 1.0]])
    stiffness = np.zeros((6, 6))
    for i, block in enumerate((kx, ky, twist)):
        stiffness[i::3, i::3] = block
    return stiffness


def _frames(column: float, span: float) -> Reals:
    """(2, 2) sway stiffness of the two frames of one direction, joint rotations condensed."""
    c, b, h = 2.0 * YOUNG * column, 12.0 * YOUNG * BEAM / span, STOREY
    sway = 12.0 * c / h**3 * np.array([[2.0, -1.0], [-1.0, 1.0]])
    mixed = 6.0 * c / h**2 * np.array([[0.0, 1.0], [-1.0, -1.0]])
    joints = np.array([[8.0 * c / h + b, 2.0 * c / h], [2.0 * c / h, 4.0 * c / h + b]])
    return 2.0 * (sway - mixed @ np.linalg.solve(joints, mixed.T))


def _with_braces(mass: Reals, stiffness: Reals, brace_mass: float) -> tuple[Reals, Reals]:
    """The braces take their mass from the first floor, which carries them, and swing across the building on it."""
    braced_mass, braced = np.zeros((7, 7)), np.zeros((7, 7))
    braced_mass[:6, :6], braced[:6, :6] = mass, stiffness
    braced_mass[[0, 1], [0, 1]] -= (0.0, brace_mass)
    braced_mass[6, 6] = brace_mass
    spring = brace_mass * (2.0 * np.pi * BRACE_HZ) ** 2
    braced[np.ix_([1, 6], [1, 6])] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return braced_mass, braced
