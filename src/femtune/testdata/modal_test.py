"""ModalTest: a vibration test of a structure in one configuration."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from femtune.dofs import Dof
from femtune.errors import FemtuneError, Notice
from femtune.modal import FrfSet, ModeSet
from femtune.modal.mode_set import read_only
from femtune.units import UnitSystem


@dataclass(frozen=True, eq=False)
class WireFrame:
    """The geometry of a test: nodes, trace lines and elements.

    Parameters
    ----------
    nodes : (n,) node numbers, each once
    coordinates : (n, 3) in the length unit of the test
    axes : (n, 3, 3); row k of ``axes[i]`` is the unit vector of node i's local direction k (X, Y, Z) in
        global axes; the identity by default
    lines : trace lines, each a tuple of two or more node numbers
    elements : faces and bars, each a tuple of node numbers

    Raises
    ------
    FemtuneError : ``test.geometry`` for inconsistent sizes and coordinates that are not finite,
        ``test.duplicate-node``, ``test.unknown-node`` for lines or elements with unknown nodes
    """

    nodes: NDArray[np.int64]
    coordinates: NDArray[np.float64]
    axes: NDArray[np.float64] | None = None
    lines: tuple[tuple[int, ...], ...] = ()
    elements: tuple[tuple[int, ...], ...] = ()
    _index: dict[int, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.nodes)
        axes = np.tile(np.eye(3), (n, 1, 1)) if self.axes is None else self.axes
        object.__setattr__(self, "nodes", read_only(self.nodes, int))
        object.__setattr__(self, "coordinates", read_only(self.coordinates, float))
        object.__setattr__(self, "axes", read_only(axes, float))
        object.__setattr__(self, "_index", {int(node): i for i, node in enumerate(self.nodes)})
        self._check_sizes(n)
        self._check_nodes(n)

    def _check_sizes(self, n: int) -> None:
        axes = np.asarray(self.axes)
        if self.coordinates.shape != (n, 3) or axes.shape != (n, 3, 3):
            sizes = {"coordinates": self.coordinates.shape, "axes": axes.shape, "nodes": n}
            raise FemtuneError("test.geometry", values=sizes)
        bad = self.nodes[~np.isfinite(self.coordinates).all(axis=1)]
        if bad.size:
            raise FemtuneError("test.geometry/coordinates", nodes=_some(bad))

    def _check_nodes(self, n: int) -> None:
        if len(self._index) != n:
            numbers, counts = np.unique(self.nodes, return_counts=True)
            raise FemtuneError("test.duplicate-node", nodes=_some(numbers[counts > 1]))
        missing = sorted({node for path in (*self.lines, *self.elements) for node in path} - set(self._index))
        if missing:
            raise FemtuneError("test.unknown-node", nodes=_some(missing))

    def __len__(self) -> int:
        return len(self.nodes)

    def __contains__(self, node: int) -> bool:
        return node in self._index

    def position(self, node: int) -> NDArray[np.float64]:
        """(3,) coordinates of a node (error ``test.unknown-node``)."""
        return self.coordinates[self._at(node)]

    def direction(self, dof: Dof) -> NDArray[np.float64]:
        """(3,) unit vector of a DOF in global axes, its sign included; of the axis for a rotation.

        Raises
        ------
        FemtuneError : ``test.unknown-node``; ``test.scalar-point`` for a DOF without direction
        """
        if dof.component == 0:
            raise FemtuneError("test.scalar-point", dof=dof)
        assert self.axes is not None
        return dof.sign * self.axes[self._at(dof.node), (dof.component - 1) % 3]

    def _at(self, node: int) -> int:
        if node not in self._index:
            raise FemtuneError("test.unknown-node/requested", node=node)
        return self._index[node]


NO_GEOMETRY = WireFrame(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
"""The geometry of a test without geometry."""


@dataclass(frozen=True, eq=False)
class Sensor:
    """One measured degree of freedom.

    Parameters
    ----------
    label : the DOF that names it in modes and FRFs
    position : (3,) in the length unit of the test
    direction : (3,) unit vector in global axes, of the motion or (RX, RY, RZ) of the axis of rotation; the
        label's sign is included
    """

    label: Dof
    position: NDArray[np.float64]
    direction: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", read_only(self.position, float))
        object.__setattr__(self, "direction", read_only(self.direction, float))

    @property
    def is_rotation(self) -> bool:
        """True where it measures a rotation."""
        return self.label.component > 3


@dataclass(frozen=True, eq=False, repr=False)
class ModalTest:
    """A vibration test of one configuration of the structure, with its added masses and supports.

    Parameters
    ----------
    name : name of the test
    units : units of coordinates, mass-normalised shapes and FRFs
    geometry : geometry of the test (empty if the source has none)
    sensors : sensors with known position, each label once
    modes, frfs : the identified modes and the measured functions, or None
    exponential_s : time constant τ in s of the exponential window e^{−t/τ} with which the functions were made; None
        without one
    conditions : further information on the test, by name
    source : its file
    notices : notices of the reader

    Raises
    ------
    FemtuneError : ``test.duplicate-sensor``

    Examples
    --------
    >>> import femtune as ft
    >>> from femtune.testing import example_test
    >>> ft.read_test(example_test())
    ModalTest: cantilever, 4 points, 8 sensors, 4 modes, units m-kg-s
    """

    name: str
    units: UnitSystem
    geometry: WireFrame = NO_GEOMETRY
    sensors: tuple[Sensor, ...] = ()
    modes: ModeSet | None = None
    frfs: FrfSet | None = None
    conditions: tuple[tuple[str, str], ...] = ()
    source: str = ""
    notices: tuple[Notice, ...] = ()
    exponential_s: float | None = None

    @property
    def decay(self) -> float:
        """1/τ of this window in rad/s; 0 without one."""
        return 0.0 if self.exponential_s is None else 1.0 / self.exponential_s

    def __post_init__(self) -> None:
        seen: set[tuple[int, str]] = set()
        for label in (sensor.label for sensor in self.sensors):
            if (label.node, label.direction) in seen:
                raise FemtuneError("test.duplicate-sensor", label=label)
            seen.add((label.node, label.direction))

    def __repr__(self) -> str:
        modes = [f"{len(self.modes)} modes"] if self.modes is not None else []
        frfs = [f"{len(self.frfs.responses)} × {len(self.frfs.references)} FRFs"] if self.frfs is not None else []
        parts = [self.name, f"{len(self.geometry)} points", f"{len(self.sensors)} sensors", *modes, *frfs]
        return f"ModalTest: {', '.join([*parts, f'units {self.units.word}'])}"


def sensors_at(geometry: WireFrame, dofs: Iterable[Dof]) -> tuple[Sensor, ...]:
    """Sensors for those `dofs` whose node is in the wire frame, in its local directions, each DOF once."""
    labels = {(d.node, d.direction): d for d in reversed(list(dofs)) if d.node in geometry and d.component}
    return tuple(Sensor(d, geometry.position(d.node), geometry.direction(d)) for d in reversed(list(labels.values())))


def _some(items: Iterable[object], most: int = 5) -> str:
    texts = [str(item) for item in items]
    return ", ".join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")
