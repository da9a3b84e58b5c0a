"""Configuration: the structure in one state, as changes of the deck."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from femtune.errors import FemtuneError
from femtune.fem import NodeTable, Structure
from femtune.fem.generic import check_whole
from femtune.model.kinds import BASELINE
from femtune.model.terms import Term, constant_term


@dataclass(frozen=True)
class AddedMass:
    """A rigid mass on a grid point: a sensor, a shaker's moving part, a block.

    Parameters
    ----------
    node : grid point
    mass : in the mass unit of the study (PARAM WTMASS does not scale it)
    offset : (3,) from the grid point to its centre of gravity, basic frame
    inertia : (3, 3) about its centre of gravity, basic frame
    of_test : whether it is a part of the test equipment whose effect on the modes is stated
    """

    node: int
    mass: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[tuple[float, float, float], ...] = ((0.0,) * 3,) * 3
    label: str = ""
    of_test: bool = False


@dataclass(frozen=True)
class Configuration:
    """One state of the structure and what belongs to it.

    Parameters
    ----------
    elements_off : numbers of elements (rigid ones too) that are switched off
    support_set, multipoint_set : numbers of the sets that hold; None takes the deck's own selection
    supports_added, supports_removed : (node, components) pairs such as (12, "123")
    masses : rigid masses that are added
    weighed_mass, weighed_centre, weighed_inertia : measured mass, centre of gravity and moments of inertia about it of
        this configuration, in the basic axes, for comparison; None without measurement
    """

    name: str = BASELINE
    elements_off: frozenset[int] = frozenset()
    support_set: int | None = None
    multipoint_set: int | None = None
    supports_added: tuple[tuple[int, str], ...] = ()
    supports_removed: tuple[tuple[int, str], ...] = ()
    masses: tuple[AddedMass, ...] = field(default_factory=tuple)
    weighed_mass: float | None = None
    weighed_centre: tuple[float, float, float] | None = None
    weighed_inertia: tuple[float, float, float] | None = None

    @property
    def state(self) -> Configuration:
        """What the matrices depend on: configurations with the same state differ in name and weighing only."""
        return replace(self, name="", weighed_mass=None, weighed_centre=None, weighed_inertia=None)


def held_dofs(structure: Structure, configuration: Configuration) -> NDArray[np.int64]:
    """g-set DOFs that grid points, the support set and the overlays hold.

    Raises
    ------
    FemtuneError : ``configuration.unknown-set``, ``configuration.not-held``, or ``model.unknown-node``
    """
    number = configuration.support_set
    number = structure.default_support_set if number is None else number
    held = {int(i) for i in structure.permanent} | _set_members(structure, configuration, number)
    for node, components in configuration.supports_removed:
        dofs = _dofs(structure, node, components)
        if not dofs <= held:
            raise FemtuneError(
                "configuration.not-held", configuration=configuration.name, node=node, components=components
            )
        held -= dofs
    for node, components in configuration.supports_added:
        held |= _dofs(structure, node, components)
    return np.array(sorted(held), dtype=np.int64)


def _dofs(structure: Structure, node: int, components: str) -> set[int]:
    return {structure.nodes.dof(node, int(c)) for c in components}


def _set_members(structure: Structure, configuration: Configuration, number: int | None) -> set[int]:
    if number is None:
        return set()
    if number not in structure.support_sets:
        raise _unknown_set("configuration.unknown-set/supports", configuration, number, structure.support_sets)
    return {int(i) for i in structure.support_sets[number]}


def _unknown_set(code: str, configuration: Configuration, number: int, known: object) -> FemtuneError:
    numbers = ", ".join(str(n) for n in sorted(known)) or "none"  # type: ignore[call-overload]
    return FemtuneError(code, values={"known": numbers}, configuration=configuration.name, number=number)


def check_configuration(structure: Structure, configuration: Configuration) -> None:
    """Refuse what the deck does not have: elements, multipoint sets, nodes of masses.

    Raises
    ------
    FemtuneError : ``configuration.unknown-element``, ``configuration.unknown-set``, ``model.unknown-node`` or
        ``generic.switched-off``
    """
    unknown = sorted(configuration.elements_off - set(structure.element_kinds))
    if unknown:
        raise FemtuneError(
            "configuration.unknown-element",
            values={"elements": ", ".join(map(str, unknown[:10]))},
            configuration=configuration.name,
        )
    check_whole(structure, configuration.elements_off)
    number = configuration.multipoint_set
    if number is not None and number not in structure.multipoint_sets:
        raise _unknown_set("configuration.unknown-set/multipoint", configuration, number, structure.multipoint_sets)
    for mass in configuration.masses:
        structure.nodes.position(mass.node)


def mass_terms(nodes: NodeTable, masses: tuple[AddedMass, ...]) -> list[Term]:
    """Constant terms of the masses that a configuration adds."""
    if not masses:
        return []
    at = np.array([nodes.position(m.node) for m in masses])
    matrices = mass_matrices(nodes, masses)
    zeros = np.zeros(len(masses), np.int64)
    dofs = 6 * at[:, None] + np.arange(6)
    return [constant_term("mass", "added mass", zeros, dofs, matrices)]


def mass_matrices(nodes: NodeTable, masses: tuple[AddedMass, ...]) -> NDArray[np.float64]:
    """(a, 6, 6) matrices of added masses at their grid points, in the displacement frames of these."""
    matrices = [_mass_matrix(m, nodes.frames[nodes.position(m.node)]) for m in masses]
    return np.stack(matrices) if matrices else np.zeros((0, 6, 6))


def _mass_matrix(added: AddedMass, frame: NDArray[np.float64]) -> NDArray[np.float64]:
    """(6, 6) matrix at the grid point, in its displacement frame: BᵀB-form of the rigid arm to the centre."""
    x, y, z = added.offset
    arm = np.eye(6)
    arm[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    centre = np.zeros((6, 6))
    centre[:3, :3] = added.mass * np.eye(3)
    centre[3:, 3:] = np.asarray(added.inertia)
    turn = np.kron(np.eye(2), frame)
    return turn.T @ arm.T @ centre @ arm @ turn
