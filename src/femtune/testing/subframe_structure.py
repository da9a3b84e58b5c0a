"""A meshed structure as arrays, ready to be written as a deck: nodes, elements, properties, masses, rigid ties."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.testing.subframe_patches import Weld

Reals = NDArray[np.float64]
Integers = NDArray[np.int64]

FIRST_NODE = 1001
"""Number of the first ordinary grid; sensors, bolts and mounts lie below."""

_NEAR_ENOUGH, _MOST_OFF, _TRIALS = 0.03, 0.1, 7

_CARDS = {
    ("PSHELL", 3): "CTRIA3",
    ("PSHELL", 4): "CQUAD4",
    ("PSOLID", 8): "CHEXA",
    ("PBAR", 2): "CBAR",
}


@dataclass(frozen=True)
class Material:
    """A MAT1 in SI units: Pa, kg/m³, loss factor."""

    id: int
    name: str
    E: float
    nu: float
    rho: float
    GE: float = 0.0


@dataclass(frozen=True)
class Property:
    """A PSHELL (values: thickness in m), PSOLID (none) or PBAR (A, I1, I2, J); its name is the elements' group."""

    id: int
    name: str
    card: str
    material: int
    values: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one card and one property: numbers (e,) and nodes (e, k) as rows of the node table."""

    card: str
    property: int
    ids: Integers
    rows: Integers


@dataclass(frozen=True, eq=False)
class RigidTie:
    """An RBE2: the components of the nodes at `rows` follow the node at row `centre`."""

    id: int
    name: str
    centre: int
    rows: Integers
    components: str = "123456"


@dataclass(frozen=True)
class PointMass:
    """A CONM2 in kg (and kg·m² about its three axes) on the node at `row`."""

    id: int
    name: str
    row: int
    mass: float
    inertia: float = 0.0


@dataclass(frozen=True, eq=False)
class MeshedStructure:
    """Nodes and everything that hangs on them, in metres, newtons and kilograms.

    Parameters
    ----------
    title : one line for the deck
    node_ids : (n,) numbers of the grids
    xyz : (n, 3) positions in m
    """

    title: str
    node_ids: Integers
    xyz: Reals
    elements: tuple[Elements, ...]
    properties: tuple[Property, ...]
    materials: tuple[Material, ...]
    rigid: tuple[RigidTie, ...] = ()
    masses: tuple[PointMass, ...] = ()

    @property
    def thickness_groups(self) -> dict[int, str]:
        """Names of the groups that have a thickness, by PSHELL number."""
        return {p.id: p.name for p in self.properties if p.card == "PSHELL"}

    @cached_property
    def n_dofs(self) -> int:
        """Degrees of freedom that are left when rotations of solids and what RBE2 tie are taken away."""
        return free_dofs(len(self.xyz), self.elements, self.rigid)

    def group(self, name: str) -> tuple[Elements, ...]:
        """Elements of the property of that name."""
        ids = {p.id for p in self.properties if p.name == name}
        return tuple(batch for batch in self.elements if batch.property in ids)


def free_dofs(count: int, elements: Sequence[Elements], rigid: Sequence[RigidTie] = ()) -> int:
    """6 for a node of a shell, a bar or in the middle of a tie, 3 for one of solids only, less what follows ties."""
    dofs = np.full(count, 3)
    for batch in elements:
        if batch.card != "CHEXA":
            dofs[batch.rows] = 6
    dofs[[tie.centre for tie in rigid]] = 6
    for tie in rigid:
        dofs[tie.rows] -= len(tie.components)
    return int(dofs.sum())


def element_batches(mesh: Weld, properties: Sequence[Property]) -> tuple[Elements, ...]:
    """The cells of a mesh numbered through from 1, in the order of the properties."""
    batches, start = [], 1
    for entry in properties:
        for corners in (2, 3, 4, 8):
            cells = mesh.cells.get((entry.name, corners))
            if cells is not None:
                ids = np.arange(start, start + len(cells))
                batches.append(Elements(_CARDS[entry.card, corners], entry.id, ids, cells))
                start += len(cells)
    return tuple(batches)


def node_numbers(count: int, named: Mapping[int, int]) -> Integers:
    """Numbers of the grids: those `named` (by row), the others from FIRST_NODE on."""
    numbers = np.arange(FIRST_NODE, FIRST_NODE + count)
    numbers[list(named)] = list(named.values())
    return numbers


def sized(builds: Sequence[Callable[[float], MeshedStructure]], n_dofs: int, guess: float) -> MeshedStructure:
    """The mesh that comes closest to a number of degrees of freedom, over element sizes (m) from `guess` on.

    Each of `builds` makes a mesh of a size; where the first has a gap at this number, the next ones are tried.

    Raises
    ------
    FemtuneError : ``testing.mesh-size`` where no mesh comes within ten per cent
    """
    closest: list[MeshedStructure] = []
    for build in builds:
        closest.append(_closest(build, n_dofs, guess))
        if _off(closest[-1], n_dofs) < _NEAR_ENOUGH:
            return closest[-1]
    best = min(closest, key=lambda one: _off(one, n_dofs))
    if _off(best, n_dofs) > _MOST_OFF:
        raise _no_such_size(n_dofs, best.n_dofs)
    return best


def _closest(build: Callable[[float], MeshedStructure], n_dofs: int, size: float) -> MeshedStructure:
    """Bracketing by the power law of the numbers; they grow in steps, so the best of all trials counts."""
    best = made = build(size)
    low, high = 0.0, np.inf
    for _ in range(_TRIALS):
        if _off(best, n_dofs) < _NEAR_ENOUGH:
            break
        low, high = (size, high) if made.n_dofs > n_dofs else (low, size)
        size = _next_size(size * np.sqrt(made.n_dofs / n_dofs), low, high)
        made = build(size)
        best = min(best, made, key=lambda one: _off(one, n_dofs))
    return best


def _off(made: MeshedStructure, n_dofs: int) -> float:
    return abs(made.n_dofs / n_dofs - 1.0)


def _next_size(size: float, low: float, high: float) -> float:
    """The size that is aimed at, or one inside the bracket where that would leave it."""
    if np.isinf(high):
        return max(size, 1.3 * low)
    return size if low < size < high else (low + high) / 2.0


def _no_such_size(wanted: int, closest: int) -> FemtuneError:
    return FemtuneError(
        "testing.mesh-size",
        "this structure cannot be meshed with so many degrees of freedom",
        values={"wanted": wanted, "closest": closest},
        hint="ask for a number within ten per cent of the closest one, or for more",
    )
